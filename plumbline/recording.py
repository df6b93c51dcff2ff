"""From the files of a trial to one recording in the pipeline's axes: merged, even in time, gaps filled, forces as reactions.

x to the subject's right, y forward, z up; SI. What was assumed or found odd stands in `notes`; a trial that cannot be used raises
`Refused`, and `tables_of` turns that into a row with its reason.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from plumbline import axes as lab
from plumbline import feet, frames, loads, rows, tables
from plumbline.errors import PlumblineError, Refused
from plumbline.events import Event, read_events
from plumbline.frames import Flags
from plumbline.loads import Plate
from plumbline.readers import read_file
from plumbline.readers.raw import Array, Raw, RawPlate
from plumbline.study import Trial

SHORTEST = 1.0  # [s] for every task but `static`
SHORTEST_STATIC = 0.2  # [s]
WITHOUT_PLATES = ("static", "leg")  # tasks that say something without forces


@dataclass
class Recording:
    """One trial, ready for the signals.

    time: of the frames [s], shape (n,), even; the file's own, need not start at 0.  rate: [Hz].
    markers: label -> (n, 3) [m], missing as NaN.  filled: label -> (n,), interpolated across a gap.
    derived: label -> (n, 3), other points of the file (CentreOfMass, joint centres).
    plates: those that carry a load.  mass: [kg] from the steady weight, NaN where the load is not steady.
    events: (onset [s] in the file's own time, duration [s], type).
    axes: e.g. "x=+Z y=+X z=+Y".  axes_from: config, or what they were found from.
    force_sign, shear_sign: factors put on the recorded forces; NaN where plates differ or nothing was recorded.
    """

    trial: Trial
    time: Array
    rate: float
    markers: dict[str, Array]
    filled: dict[str, Flags]
    derived: dict[str, Array]
    plates: list[Plate]
    mass: float = math.nan
    notes: list[str] = field(default_factory=list)
    axes: str = ""
    axes_from: str = ""
    force_sign: float = math.nan
    shear_sign: float = math.nan
    events: list[Event] = field(default_factory=list)

    @property
    def force_rate(self) -> float:
        """Rate of the first plate [Hz], NaN without plates."""
        times = [p.time for p in self.plates if p.time.size > 1]
        return float((times[0].size - 1) / (times[0][-1] - times[0][0])) if times else math.nan


Reader = Callable[[Path, Sequence[Mapping[str, Any]]], Raw]


def assemble(
    trial: Trial,
    *,
    columns: Sequence[Mapping[str, Any]] = (),
    axes: str | Mapping[str, str] = "auto",
    max_gap: float = 0.1,  # [s]
    read: Reader = read_file,
) -> Recording:
    """Read all files of a trial and make one recording of them.

    columns: the config's `columns:`.  axes: "auto", or {x: "+Z", y: "+X", z: "+Y"}.  max_gap: longest gap that is filled [s].
    read: reads one file.
    Raises Refused with any reason of a reader, or no_data, no_plates, unloaded, stuck_channel, too_short, bad_time, bad_events.
    """
    raw, hole = frames.even(frames.merge([_read(f, columns, read) for f in trial.files]), max_gap)
    _check(raw, trial)
    notes = list(dict.fromkeys([*raw.notes, *(f"plate {i}: {n}" for i, p in enumerate(raw.plates, 1) for n in p.notes)]))
    carrying = loads.usable(raw.plates, trial.task, notes) if raw.plates else {}
    found = lab.configured(axes) if isinstance(axes, Mapping) else _find_axes(raw, carrying, trial.task)
    gaps = frames.fill(lab.turned(raw.points, found.matrix), raw.rate, max_gap)
    seen = [i for i in range(len(raw.labels)) if np.isfinite(gaps.points[:, i, 0]).any()]
    unseen = [label for i, label in enumerate(raw.labels) if i not in seen]
    if unseen:
        notes.append(f"markers never seen, left out: {', '.join(unseen)}")
    out = Recording(
        trial, raw.time, raw.rate,
        {raw.labels[i]: gaps.points[:, i] for i in seen},
        {raw.labels[i]: gaps.filled[:, i] | (hole & np.isfinite(gaps.points[:, i, 0])) for i in seen},
        {name: lab.turned(values, found.matrix) for name, values in raw.derived.items()},
        [], notes=notes + found.notes, axes=found.text, axes_from=found.origin,
    )  # fmt: skip
    _put_plates(out, raw, carrying, found)
    if not out.time.size:
        out.time, out.rate = out.plates[0].time, out.force_rate
    if trial.events:
        out.events = read_events(trial.events, float(out.time[0]), float(out.time[-1]), out.notes)
    return out


def _find_axes(raw: Raw, carrying: Mapping[int, RawPlate], task: str) -> lab.Axes:
    """Axes from the recording; the CoM of the file helps where markers are few, plates that nobody loads do not."""
    points, labels = raw.points, list(raw.labels)
    if "CentreOfMass" in raw.derived:
        points, labels = np.concatenate([points, raw.derived["CentreOfMass"][:, None]], axis=1), [*labels, "com"]
    return lab.find(points, labels, [] if task == "empty" else loads.floor(list(carrying.values())))


def _read(file: Path, columns: Sequence[Mapping[str, Any]], read: Reader) -> Raw:
    """One file; whatever a reader stumbles over makes the file unreadable, not the run."""
    try:
        return read(file, columns)
    except PlumblineError:
        raise
    except Exception as error:
        raise Refused(
            "unreadable",
            f"{file.name}: {type(error).__name__}: {error}",
            "export the file again; if it opens elsewhere, please report it",
        ) from error


def _check(raw: Raw, trial: Trial) -> None:
    """Refuse what no later stage can use: no_data, no_plates, too_short."""
    spots = bool(np.isfinite(raw.points).any()) or any(np.isfinite(v).any() for v in raw.derived.values())
    pressed = bool(raw.plates) or "cop_x" in raw.channels
    names = " + ".join(f.name for f in trial.files)
    if not spots and not pressed:
        raise Refused("no_data", f"{names} holds neither markers, nor a CoM, nor forces", "give the files of the recording itself")
    if not pressed and trial.task not in WITHOUT_PLATES:
        raise Refused(
            "no_plates",
            f"{names} has no force plate",
            "add the file of the forces under the same entities, or record with plates",
        )
    time = raw.time if raw.time.size else raw.plates[0].time
    lasts = float(time[-1] - time[0]) if time.size else 0.0
    least = SHORTEST_STATIC if trial.task == "static" else SHORTEST
    if lasts < least - 1e-6:
        raise Refused("too_short", f"{names} lasts {lasts:.2f} s, task {trial.task} needs {least:g} s", "use a longer recording")


# -- plates -----------------------------------------------------------------------------------------------------------


def _put_plates(out: Recording, raw: Raw, carrying: Mapping[int, RawPlate], found: lab.Axes) -> None:
    """Plates as reactions on the person, with mass, signs and feet (in place)."""
    if not carrying:
        if "cop_x" in raw.channels:
            out.plates = [_cop_alone(raw, found.matrix)]
            out.notes.append("CoP without forces: only measures of the CoP can be had")
        return
    empty = out.trial.task == "empty"
    stated = 1.0 if empty else None
    made = {i: loads.reaction(i, p, found.matrix, stated) for i, p in carrying.items() if p.foot != loads.NO_FOOT}
    signs = {sign for _, sign in made.values()}
    # a hand may pull either way: what it says has the sign of the plates
    made |= {i: loads.reaction(i, p, found.matrix, min(signs, default=1.0)) for i, p in carrying.items() if i not in made}
    out.plates = [made[i][0] for i in carrying]
    out.force_sign = signs.pop() if len(signs) == 1 else math.nan
    if math.isnan(out.force_sign):
        said = ", ".join(f"plate {p.number} {s:+.0f}" for p, s in made.values())
        out.notes.append(f"plates differ in the sign of their vertical force: {said}")
    loads.drop_light(out.plates)
    if empty:
        return
    places = feet.places(out.markers)
    assumed = "assumed" in out.axes_from
    feet.assign(out.plates, out.time, places, out.notes, known_lateral=not assumed)
    stand = loads.standing(out.plates, climb(out))
    out.mass, out.shear_sign = stand.mass, stand.shear
    out.notes += stand.notes
    if out.shear_sign < 0:
        for plate in loads.floor(out.plates):
            loads.turn_shear(plate)


def climb(recording: Recording) -> float:
    """Mean vertical acceleration of the markers that are never missing, from their first and last 0.1 s [m/s2].

    Stands for the body's: it is 0 but for trials that begin or end in motion (a fall). 0 without such markers.
    """
    whole = [v[:, 2] for v in recording.markers.values() if np.isfinite(v[:, 2]).all()]
    n = max(1, round(0.1 * recording.rate)) if math.isfinite(recording.rate) else 1
    if not whole or recording.time.size < 4 * n:
        return 0.0
    z = np.mean(whole, axis=0)
    gain = (z[-1] - z[-1 - n]) - (z[n] - z[0])
    return float(gain * recording.rate / n / (recording.time[-1] - recording.time[0]))


def _cop_alone(raw: Raw, matrix: Array) -> Plate:
    """A CoP that came without forces, as a plate whose forces are NaN."""
    cop = np.column_stack([raw.channels[f"cop_{a}"] for a in "xyz"])
    cop[:, np.isnan(cop).all(axis=0)] = 0.0
    blank = np.full(cop.shape, np.nan)
    return Plate(1, raw.time, blank, blank.copy(), lab.turned(cop, matrix), blank[:, 0].copy())


# -- tables -----------------------------------------------------------------------------------------------------------

Tables = tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]


def each(
    trials: Iterable[Trial],
    *,
    columns: Sequence[Mapping[str, Any]] = (),
    axes: str | Mapping[str, str] = "auto",
    max_gap: float = 0.1,  # [s]
    raw: Path | None = None,
    read: Reader = read_file,
) -> Iterator[tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]]:
    """One trial after the other: its row of `trials` and its rows of `markers` and `plates`.

    A refused trial has a row with its reason, and no others.  raw: the folder below which `files` are named; without it by their
    names alone.  Other arguments as in `assemble`.
    """
    for trial in trials:
        try:
            recording = assemble(trial, columns=columns, axes=axes, max_gap=max_gap, read=read)
        except Refused as refusal:
            yield rows.refused_row(trial, refusal, raw), tables.empty("markers"), tables.empty("plates")
        else:
            yield to_tables(recording, raw)


def tables_of(trials: Iterable[Trial], **options: Any) -> Tables:
    """Tables `trials`, `markers` and `plates` of some trials in memory; arguments as in `each`."""
    found = list(each(trials, **options))
    lines, markers, plates = [f[0] for f in found], [f[1] for f in found], [f[2] for f in found]
    return rows.table("trials", lines), rows.joined("markers", markers), rows.joined("plates", plates)


def to_tables(recording: Recording, raw: Path | None = None) -> tuple[dict[str, Any], pd.DataFrame, pd.DataFrame]:
    """The row of `trials` and the rows of `markers` and `plates` of one recording (text columns as categories)."""
    r = recording
    missing = sum(int((~np.isfinite(v[:, 0])).sum()) for v in r.markers.values())
    row = rows.key_row(r.trial, raw) | {
        "events": json.dumps([list(e) for e in r.events]) if r.trial.events else "",
        "rate": r.rate, "force_rate": r.force_rate, "frames": int(r.time.size), "duration": float(r.time[-1] - r.time[0]),
        "markers": len(r.markers), "plates": len(r.plates), "missing": missing,
        "filled": sum(int(f.sum()) for f in r.filled.values()),
        "corners": json.dumps([None if p.corners is None else p.corners.tolist() for p in r.plates]),
        "axes": r.axes, "axes_from": r.axes_from, "force_sign": r.force_sign, "shear_sign": r.shear_sign, "mass": r.mass,
        "notes": json.dumps(r.notes, ensure_ascii=False),
    }  # fmt: skip
    return row, rows.marker_rows(r), rows.plate_rows(r)


def recordings(trials: pd.DataFrame, rows_of: Callable[[str, str], pd.DataFrame]) -> Iterator[Recording]:
    """The recordings behind the tables, in the order of `trials`; refused trials are passed over (their row holds the reason).

    rows_of: (name of a table, trial) -> its rows, so that one trial at a time is in memory.
    """
    for _, row in trials[trials["reason"] == ""].iterrows():
        yield from_tables(row, rows_of("markers", row["trial"]), rows_of("plates", row["trial"]))


def from_tables(row: Mapping[str, Any] | pd.Series, markers: pd.DataFrame, plates: pd.DataFrame) -> Recording:
    """The recording behind one row of `trials` and the rows of this trial in `markers` and `plates`."""
    name, subject, session, task, condition, run = (str(row[k]) for k in ("trial", "subject", "session", "task", "condition", "run"))
    trial = Trial(name, subject, session, task, condition, run, files=())
    rows_of = {str(k): v for k, v in markers.groupby("marker", sort=False, observed=True)}
    points = {k: v[["x", "y", "z"]].to_numpy() for k, v in rows_of.items()}
    parts = [(int(str(number)), part) for number, part in plates.groupby("plate", sort=False)]
    corners = json.loads(row["corners"] or "[]")
    boards = [_plate_of(number, part, c) for (number, part), c in zip(parts, corners, strict=True)]
    return Recording(
        trial, next(iter(rows_of.values()))["time"].to_numpy() if rows_of else boards[0].time, float(row["rate"]),
        {k: v for k, v in points.items() if not k.startswith("@")},
        {k: v["filled"].to_numpy() for k, v in rows_of.items() if not k.startswith("@")},
        {k[1:]: v for k, v in points.items() if k.startswith("@")},
        boards, float(row["mass"]), json.loads(row["notes"] or "[]"), str(row["axes"]), str(row["axes_from"]),
        float(row["force_sign"]), float(row["shear_sign"]),
        [(float(t), float(d), str(k)) for t, d, k in json.loads(row["events"] or "[]")],
    )  # fmt: skip


def _plate_of(number: int, part: pd.DataFrame, corners: list[list[float]] | None) -> Plate:
    force, moment, cop = (part[[f"{what}_{a}" for a in "xyz"]].to_numpy() for what in ("force", "moment", "cop"))
    free, foot = part["free_moment"].to_numpy(), str(part["foot"].iloc[0])
    return Plate(number, part["time"].to_numpy(), force, moment, cop, free, None if corners is None else np.array(corners), foot)
