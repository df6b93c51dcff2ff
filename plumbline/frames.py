"""Frames of a trial: several files made one, uneven time made even, short gaps filled. Lab axes, SI."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from plumbline.errors import Refused
from plumbline.readers.numbers import is_even
from plumbline.readers.raw import Array, Raw, RawPlate

Flags = NDArray[np.bool_]


def merge(parts: list[Raw]) -> Raw:
    """One recording from all files of a trial.

    The first file with frames gives the time base; frames of another file are brought to it (linear interpolation, noted) unless
    they coincide within half a frame. A label that is there already is left out with a note. Plates of all files are kept.
    Raises Refused(bad_time) where two files share no time.
    """
    held = {"markers": [bool(p.labels) for p in parts], "force plates": [bool(p.plates) for p in parts]}
    for what, holds in held.items():
        if sum(holds) > 1:
            raise Refused(
                "duplicate",
                f"{len(parts)} files of one trial, and more than one of them holds {what}",
                "give each trial its own run: in its name, in recordings.tsv, or with {run} in the pattern of `plumbline adopt`",
            )
    base = next((p for p in parts if p.time.size), parts[0])
    out = replace(base, labels=list(base.labels), derived=dict(base.derived), channels=dict(base.channels), plates=[], notes=[])
    for part in parts:
        out.notes += part.notes
        out.plates += part.plates
        if part is not base and part.time.size:
            _add(out, part)
    for plate in out.plates:
        if out.time.size and (plate.time[-1] < out.time[0] or plate.time[0] > out.time[-1]):
            raise Refused(
                "bad_time",
                f"forces run from {plate.time[0]:g} to {plate.time[-1]:g} s, markers from {out.time[0]:g} to {out.time[-1]:g} s",
                "the files of one trial must share their clock: correct the time of one",
            )
    return out


def _add(out: Raw, part: Raw) -> None:
    """Add the points, derived points and channels of another file, in place."""
    same = part.time.size == out.time.size and np.max(np.abs(part.time - out.time)) <= 0.5 / out.rate
    if not same:
        out.notes.append(f"{part.time.size} frames at {part.rate:g} Hz brought to the {out.time.size} at {out.rate:g} Hz of the other file")
    new = [i for i, label in enumerate(part.labels) if label not in out.labels]
    if len(new) < len(part.labels):
        out.notes.append(f"labels in two files; the first file's are used: {', '.join(x for x in part.labels if x in out.labels)}")
    points = part.points[:, new] if same else _sampled(part.time, part.points[:, new], out.time)
    out.points = np.concatenate([out.points, points], axis=1)
    out.labels += [part.labels[i] for i in new]
    for there, here in ((part.derived, out.derived), (part.channels, out.channels)):
        for name, values in there.items():
            here.setdefault(name, values if same else _sampled(part.time, values, out.time))


def _sampled(time: Array, values: Array, at: Array) -> Array:
    """Linear interpolation along the first axis; NaN outside and beside missing samples."""
    flat = values.reshape(time.size, -1)
    out = np.column_stack([np.interp(at, time, c, left=np.nan, right=np.nan) for c in flat.T]) if flat.size else np.empty((at.size, 0))
    return out.reshape(at.size, *values.shape[1:])


# -- even time --------------------------------------------------------------------------------------------------------


def even(raw: Raw, max_gap: float) -> tuple[Raw, Flags]:
    """Frames and plates on even time; frames already even are passed through as they are.

    Returns the recording and which frames stand in a hole of the time stamps, shape (n,); holes over `max_gap` [s] are NaN.
    """
    plates = [_even_plate(p, max_gap) for p in raw.plates]
    notes = list(raw.notes)
    hole = np.zeros(raw.time.size, dtype=bool)
    if raw.time.size < 3 or is_even(raw.time):
        return replace(raw, plates=plates), hole
    grid = _grid(raw.time, raw.rate)
    notes.append(_said("frames", raw.time, raw.rate))
    points, hole = resample(raw.time, raw.points, grid, raw.rate, max_gap)
    derived = {k: resample(raw.time, v, grid, raw.rate, max_gap)[0] for k, v in raw.derived.items()}
    channels = {k: resample(raw.time, v, grid, raw.rate, max_gap)[0] for k, v in raw.channels.items()}
    return replace(raw, time=grid, points=points, derived=derived, channels=channels, plates=plates, notes=notes), hole


def _even_plate(plate: RawPlate, max_gap: float) -> RawPlate:
    if plate.time.size < 3 or is_even(plate.time):
        return plate
    rate = float(1.0 / np.median(np.diff(plate.time)))
    grid = _grid(plate.time, rate)
    force, moment = (resample(plate.time, a, grid, rate, max_gap)[0] for a in (plate.force, plate.moment))
    return replace(plate, time=grid, force=force, moment=moment, notes=[*plate.notes, _said("force samples", plate.time, rate)])


def _grid(time: Array, rate: float) -> Array:
    return float(time[0]) + np.arange(int(np.floor((time[-1] - time[0]) * rate + 1e-6)) + 1) / rate


def _said(what: str, time: Array, rate: float) -> str:
    steps = np.diff(time)
    return f"uneven time: {what} are {steps.min() * 1e3:.3g} to {steps.max() * 1e3:.3g} ms apart; interpolated to {rate:.4g} Hz"


def resample(time: Array, values: Array, grid: Array, rate: float, max_gap: float) -> tuple[Array, Flags]:
    """Shape-preserving cubic interpolation to even time.

    values: shape (n, ...).  A new sample is missing where one of its two neighbours is, or where they are further apart than
    `max_gap`.  Returns the values and the flags of new samples inside a hole (neighbours more than 1.5 intervals apart).
    """
    flat = values.reshape(time.size, -1)
    left = np.clip(np.searchsorted(time, grid, side="right") - 1, 0, time.size - 2)
    gap = time[left + 1] - time[left]
    on_sample = np.isclose(grid, time[left], atol=1e-9)
    hole = (gap > 1.5 / rate) & ~on_sample
    out = np.full((grid.size, flat.shape[1]), np.nan)
    whole = np.isfinite(flat).all(axis=0)
    if whole.any():
        out[:, whole] = PchipInterpolator(time, flat[:, whole], axis=0)(grid)
    for c in np.flatnonzero(~whole):
        valid = np.isfinite(flat[:, c])
        if valid.sum() >= 2:
            known = valid[left] & (valid[left + 1] | on_sample)
            out[known, c] = PchipInterpolator(time[valid], flat[valid, c])(grid[known])
    out[hole & (gap > max(max_gap, 1.5 / rate))] = np.nan
    return out.reshape(grid.size, *values.shape[1:]), hole


# -- gaps -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Filled:
    """points: shape (n, m, 3).  filled: which samples were interpolated, shape (n, m)."""

    points: Array
    filled: Flags


def fill(points: Array, rate: float, max_gap: float) -> Filled:
    """Fill gaps of at most `max_gap` [s] between valid samples with a shape-preserving cubic; longer ones stay missing.

    points: shape (n, m, 3), missing as NaN.  A gap of k missing frames lasts k/rate.  Gaps at the ends are never filled.
    """
    out = points.copy()
    missing = np.asarray(np.isnan(points).any(axis=2))
    out[missing] = np.nan
    filled = np.zeros_like(missing)
    longest = int(np.floor(max_gap * rate + 1e-6))
    for m in np.flatnonzero(missing.any(axis=0) & ~missing.all(axis=0)):
        short = _short_runs(missing[:, m], longest)
        if short.any():
            valid = np.flatnonzero(~missing[:, m])
            out[short, m] = PchipInterpolator(valid, points[valid, m], axis=0)(np.flatnonzero(short))
            filled[:, m] = short
    return Filled(out, filled)


def _short_runs(missing: Flags, longest: int) -> Flags:
    """Missing samples in runs of at most `longest` that have valid samples on both sides."""
    edges = np.diff(np.concatenate([[False], missing, [False]]).astype(np.int8))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    out = np.zeros_like(missing)
    for a, b in zip(starts, ends, strict=True):
        if a > 0 and b < missing.size and b - a <= longest:
            out[a:b] = True
    return out
