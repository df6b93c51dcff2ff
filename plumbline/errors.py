"""The errors a user meets: each says what was wrong, where, and what to do."""


class PlumblineError(Exception):
    """The study cannot be run as it stands; the message says where and what to do."""


#: reason code -> what it means; the closed list behind `exclusions.parquet`
REASONS = {
    "empty_file": "the file holds no bytes or no frames",
    "unreadable": "the file is damaged or not what its name says",
    "truncated": "the file ends before the frames its header states",
    "too_large": "reading the file takes more memory than allowed",
    "timeout": "reading the file takes longer than allowed",
    "unsupported": "no reader for this kind of file",
    "not_named": "the name follows no BIDS pattern and no recordings.tsv lists it",
    "not_listed": "recordings.tsv exists and does not list the file",
    "missing_file": "recordings.tsv lists a file that is not there",
    "no_rate": "the file states no sampling rate and the config gives none",
    "no_unit": "a unit is missing or unknown",
    "no_column": "a column that the config names is not in the file",
    "no_data": "the file holds neither markers, nor a CoM, nor forces",
    "duplicate": "two files of one trial hold the same kind of data: they are two trials",
    "no_plates": "the recording has no force plate",
    "unloaded": "nobody stands on the plates",
    "stuck_channel": "a channel of a loaded plate does not move",
    "too_short": "the trial is shorter than its analysis needs",
    "bad_time": "the time column does not increase",
    "bad_plate": "a plate's parameters do not define a wrench",
    "bad_events": "the events file cannot be read",
}


class Refused(PlumblineError):
    """One file cannot be used; the others go on.

    reason: a code of :data:`REASONS`.  message: what was wrong and where.  hint: what to do.
    """

    def __init__(self, reason: str, message: str, hint: str) -> None:
        if reason not in REASONS:
            raise ValueError(f"unknown reason code {reason!r}")
        super().__init__(f"{message} ({hint})")
        self.reason, self.message, self.hint = reason, message, hint

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:  # survives the trip from a child process
        return Refused, (self.reason, self.message, self.hint)
