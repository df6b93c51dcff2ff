"""Events of a trial: a tab-separated BIDS file with onset [s], duration [s] and trial_type."""

import csv
import math
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

from plumbline.errors import Refused

Event = tuple[float, float, str]
EVENT_TYPES = ("push", "release", "target", "locus", "switch", "bad")


def read_events(file: Path, start: float, end: float, notes: list[str]) -> list[Event]:
    """Events of a BIDS events file (onset, duration, trial_type; tab-separated), in the file's own time.

    start, end: of the recording [s]; as in BIDS an onset counts from the first sample.  Oddities go to `notes`.
    Raises Refused(bad_events) naming line and column.
    """
    with file.open(encoding="utf-8-sig", newline="") as handle:
        reader = csv.DictReader(handle, delimiter="\t")
        header = [h.strip() for h in reader.fieldnames or []]
        for name in ("onset", "trial_type"):
            if name not in header:
                raise Refused(
                    "bad_events",
                    f"{file.name} has no column '{name}' (it has: {', '.join(header) or 'nothing'})",
                    "give onset, duration and trial_type, separated by tabs",
                )
        reader.fieldnames = header
        events = [
            _event(row, file.name, reader.line_num, start)
            for row in reader
            if any((v or "").strip() for v in row.values() if isinstance(v, str))
        ]
    _note_events(events, start, end, notes)
    return sorted(events)


def _event(row: Mapping[str, str], file: str, line: int, start: float) -> Event:
    values = []
    for name in ("onset", "duration"):
        text = (row.get(name) or "").strip()
        try:
            values.append(0.0 if name == "duration" and text.lower() in ("", "n/a") else float(text))
        except ValueError:
            raise Refused(
                "bad_events", f"{file}, line {line}, column {name}: '{text}' is no number", "give seconds, or n/a for a duration"
            ) from None
    if not (math.isfinite(values[0]) and math.isfinite(values[1]) and values[1] >= 0):
        raise Refused(
            "bad_events",
            f"{file}, line {line}: onset {values[0]:g}, duration {values[1]:g}",
            "give finite seconds; a duration is not negative",
        )
    kind = (row.get("trial_type") or "").strip()
    near = get_close_matches(kind.lower(), EVENT_TYPES, n=1)
    if near and kind not in EVENT_TYPES:
        raise Refused("bad_events", f"{file}, line {line}: trial_type '{kind}'", f"did you mean '{near[0]}'?")
    return start + values[0], values[1], kind


def _note_events(events: Iterable[Event], start: float, end: float, notes: list[str]) -> None:
    outside = [f"{t:g} s" for t, _, _ in events if not start - 1e-9 <= t <= end + 1e-9]
    if outside:
        notes.append(f"events outside the recording ({start:g} to {end:g} s): {', '.join(outside)}")
    if events and abs(start) > 1e-9:
        notes.append(f"events count from the first sample, which is at {start:g} s")
    other = sorted({kind for _, _, kind in events} - set(EVENT_TYPES))
    if other:
        notes.append(f"event types without a meaning here: {', '.join(x or '(blank)' for x in other)}")
