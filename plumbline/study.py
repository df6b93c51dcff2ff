"""What a study holds: its trials, participants and events, found by name; nothing is read here but small text files.

Imports no numpy or pandas: the Snakefile calls it at each start.
"""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Participant:
    """One row of participants.tsv.  sex: "M", "F" or "" (then both sexes' segment tables are averaged)."""

    subject: str
    mass: float | None = None  # [kg]
    height: float | None = None  # [m]
    sex: str = ""


@dataclass(frozen=True)
class Trial:
    """All files with the same entities: one trial (a .trc and its .mot are one).

    trial: unique name.  files: absolute paths.  events: the events file or None.
    """

    trial: str
    subject: str
    session: str
    task: str
    condition: str
    run: str
    files: tuple[Path, ...]
    events: Path | None = None
