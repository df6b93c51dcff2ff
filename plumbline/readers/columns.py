"""What the columns of a table mean: the `columns:` section of the config, applied to one file.

One entry per kind of file; the first whose `files` pattern fits the name is used. A column is named as in the header (with or
without the unit in brackets) or by its number from 1. A vector is a list of two or three columns (null: not recorded) or a stem:
`LeftGRF` stands for LeftGRF_x, LeftGRF_y, LeftGRF_z, and for a header `LeftGRF,,` over three columns.
Units stand in brackets in the header or under `units:`; none is guessed.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from plumbline.errors import Refused
from plumbline.readers import numbers
from plumbline.readers.opensim import wrench
from plumbline.readers.raw import Array, Raw, RawPlate

Entry = Mapping[str, Any]
_UNIT = re.compile(r"^(?P<stem>.*?)\s*[\[(](?P<unit>[^\])]*)[\])]$")
_AXIS = re.compile(r"^(?P<stem>.+?)(?P<joint>[_. -]?)(?P<axis>[xyzXYZ])$")


def entry_for(path: Path, columns: Sequence[Entry]) -> Entry:
    """The first entry whose pattern fits the file's name.  Raises Refused(unsupported) where none does."""
    for entry in columns:
        if fnmatch(path.name.lower(), str(entry["files"]).lower()):
            return entry
    raise Refused(
        "unsupported",
        f"nothing says what the columns of {path.name} are",
        f"describe them in config.yaml under columns: (files: '*{path.suffix}')",
    )


@dataclass
class Table:
    """A file's columns: names as in the header, values as read, units found in brackets."""

    file: str
    names: list[str]
    values: pd.DataFrame
    entry: Entry
    stems: list[str] = field(init=False)
    units: list[str] = field(init=False)
    used: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.names = [*self.names, *[""] * (self.values.shape[1] - len(self.names))]
        found = [_UNIT.match(n) for n in self.names]
        self.stems = [m["stem"] if m else n for m, n in zip(found, self.names, strict=True)]
        self.units = [m["unit"] if m else "" for m in found]

    def index(self, ref: str | int) -> int:
        """Position of a column from 0.  Raises Refused(no_column) with the nearest name."""
        if isinstance(ref, int):
            if 1 <= ref <= self.values.shape[1]:
                return ref - 1
            raise Refused("no_column", f"{self.file} has no column {ref}; it has {self.values.shape[1]}", "correct columns: in config.yaml")
        for names in (self.names, self.stems):
            if ref in names:
                return names.index(ref)
        raise self.absent(ref)

    def absent(self, ref: str) -> Refused:
        """The error for a name that is not there."""
        have = [n for n in dict.fromkeys([*self.stems, *(s for s, _ in self.groups())]) if n]
        lower = {n.lower(): n for n in have}
        near = get_close_matches(ref.lower(), list(lower), n=1, cutoff=0.5)
        hint = f"did you mean '{lower[near[0]]}'?" if near else f"it has {', '.join(have[:8])}"
        return Refused("no_column", f"{self.file} has no column '{ref}'", f"{hint}; correct columns: in config.yaml")

    def column(self, ref: str | int, kind: str) -> Array:
        """A column in SI, shape (n,)."""
        at = self.index(ref)
        self.used.add(at)
        name = f"{self.file}, column {self.names[at] or at + 1}"
        unit = self.units[at] or str(self.entry.get("units", {}).get(kind, ""))
        return numbers.numeric(self.values.iloc[:, at], name) * numbers.factor(unit, kind, name)

    def vector(self, ref: str | Sequence[str | int | None], kind: str) -> Array:
        """Three columns in SI, shape (n, 3); a column that is not recorded is NaN."""
        refs = self.stem(ref) if isinstance(ref, str) else list(ref)
        refs += [None] * (3 - len(refs))
        blank = np.full(len(self.values), np.nan)
        return np.column_stack([blank if r is None else self.column(r, kind) for r in refs])

    def stem(self, stem: str) -> list[str | int | None]:
        """Column numbers of a stem's x, y, z.  Raises Refused(no_column)."""
        for name, places in self.groups():
            if name == stem:
                return [p + 1 for p in places]
        axes = {m["axis"].lower(): i for i, n in enumerate(self.stems) if (m := _AXIS.match(n)) and m["stem"] == stem}
        if "x" in axes and "y" in axes:
            return [axes[a] + 1 if a in axes else None for a in "xyz"]
        raise self.absent(stem)

    def groups(self) -> list[tuple[str, list[int]]]:
        """Triples of columns that carry one name: `name,,` in the header, or name_x, name_y, name_z (with a joint)."""
        out = [
            (n, [i, i + 1, i + 2])
            for i, n in enumerate(self.stems[:-2])
            if n and not self.stems[i + 1] and not self.stems[i + 2] and (i + 3 >= len(self.stems) or self.stems[i + 3])
        ]
        jointed: dict[str, dict[str, int]] = {}
        for i, name in enumerate(self.stems):
            match = _AXIS.match(name)
            if match and match["joint"]:
                jointed.setdefault(match["stem"], {})[match["axis"].lower()] = i
        return out + [(stem, [axes[a] for a in "xyz"]) for stem, axes in jointed.items() if len(axes) == 3]


def to_raw(table: Table, notes: list[str]) -> Raw:
    """The recording that a table holds, by its entry.

    Raises Refused: no_column, no_unit, no_rate, bad_time, unreadable (a cell that is no number).
    """
    entry = table.entry
    time, rate = _time(table, notes)
    plates, channels = _plates(table, time, entry.get("plates", ()))
    derived = {"CentreOfMass": table.vector(entry["com"], "length")} if "com" in entry else {}
    labels, points = _markers(table, entry.get("markers", {}))
    if not (labels or derived or channels):
        time, points = np.empty(0), np.empty((0, 0, 3))
    return Raw(time, rate, numbers.missing_as_nan(points), numbers.unique(labels, notes), derived, channels, plates, notes)


def _time(table: Table, notes: list[str]) -> tuple[Array, float]:
    entry = table.entry
    if "time" in entry:
        time = table.column(entry["time"], "time")
        return time, numbers.chosen_rate(entry.get("rate"), time, table.file, notes)
    if "rate" not in entry:
        raise Refused(
            "no_rate",
            f"{table.file}: no time column is named and no rate",
            "state `time:` or `rate:` under columns: in config.yaml",
        )
    rate = float(entry["rate"])
    return np.arange(len(table.values)) / rate, rate


def _markers(table: Table, wanted: str | Mapping[str, Any]) -> tuple[list[str], Array]:
    """Markers by name, or with `auto` every triple of columns that nothing else uses."""
    if wanted == "auto":
        wanted = {name: [p + 1 for p in places] for name, places in table.groups() if not table.used & set(places)}
    assert not isinstance(wanted, str)
    blocks = [table.vector(ref, "length") for ref in wanted.values()]
    return list(wanted), np.stack(blocks, axis=1) if blocks else np.empty((len(table.values), 0, 3))


def _plates(table: Table, time: Array, wanted: Sequence[Entry]) -> tuple[list[RawPlate], dict[str, Array]]:
    """Plates with a force; one CoP without a force goes to the channels cop_x, cop_y, cop_z."""
    plates, channels = [], {}
    for entry in wanted:
        if "force" in entry:
            plates.append(_plate(table, time, entry))
        else:
            cop = table.vector(entry["cop"], "length")
            channels = {f"cop_{a}": cop[:, i] for i, a in enumerate("xyz")}
    return plates, channels


def _plate(table: Table, time: Array, entry: Entry) -> RawPlate:
    force = table.vector(entry["force"], "force")
    corners = np.asarray(entry["corners"], dtype=float) if "corners" in entry else None
    if "cop" in entry:
        cop = table.vector(entry["cop"], "length")
        cop[:, np.isnan(cop).all(axis=0)] = 0.0  # a height that no column gives is the origin's
        free = np.zeros_like(force)
        if "free_moment" in entry:
            up = int(np.nanargmax(np.abs(np.nanmean(np.nan_to_num(force), axis=0))))
            free[:, up] = table.column(entry["free_moment"], "moment")
        origin, moment = wrench(force, cop, free)
    else:
        origin = np.asarray(entry.get("origin", (0.0, 0.0, 0.0)), dtype=float)
        moment = np.nan_to_num(table.vector(entry["moment"], "moment"))
    return RawPlate(time, force, moment, origin, corners, "text", str(entry.get("foot", "")))
