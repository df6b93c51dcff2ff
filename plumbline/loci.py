r"""Loci: stretches in which the person balances alone after a disturbance (Murai 2013, fig. 5), and how each of them ends.

A locus runs from the end of a push, or from a `release`, to the next push, `target` or the end of the trial; `bad` windows are
cut out of it, and a `locus` event overrides what was found. A trial without push or release is
one locus where it starts away from rest. All is lateral (x). Position and velocity are those of the CoM, low-passed at 6 Hz
(the 2 Hz of the figures would smear the push into the locus).

- *reference*: median position in the second before each push (where the mean speed there is below 5 cm/s), over the trial or
  between two `target` events; without such a stretch, of all frames that are slow; else of all frames.
- *returned*: for 0.25 s the CoM stays within 2 cm of the reference at less than 5 cm/s.
- *beyond*: at the start the CoM is outside the borders of the support, both feet's as long as both are on the floor, whatever
  each bears (Murai 2013: loci that start with the CoM beyond the stance). No ZMP can be outside of it, the CoM accelerates
  outwards, and only its velocity brings it back. A person's own limits of the ZMP lie a little inside the feet's outline and are
  not known here: a start between the two counts as within.
- `falling`: at its end the extrapolated CoM :math:`x + \dot x/\omega` (Hof 2005), :math:`\omega^2 = g/z`, lies outside the
  borders and moves outwards. Else `recovering`: returned; `recovering_from_beyond`: returned, and began beyond; `unrecovered`:
  neither, the next push or the end of the trial came first.
- A CoM outside the support accelerates outwards, whatever the person does. Where it accelerates inwards there at more than
  0.5 m/s2 somebody caught the fall: a falling locus ends before.

Borders are the support limits where known, else the range of the ZMP in the trial.
"""

import json
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import filters, tables
from plumbline.physics import G
from plumbline.pushes import Event, pushes

Array = NDArray[np.float64]

TASKS_WITH_LOCI = ("lateral",)
STARTS = ("push", "release", "locus")  # events that give a trial of any task its loci
CUTOFF = 6.0  # [Hz]
CAUGHT_CUTOFF = 3.0  # [Hz] of the acceleration: at 6 Hz 1 mm of white noise makes 0.16 m/s2, at 3 Hz 0.03
SHORTEST = 0.3  # [s] a shorter stretch is no locus
REST = 1.0  # [s] before a push
SLOW = 0.05  # [m/s]
BAND = 0.02  # [m]
SETTLED = 0.25  # [s]
CAUGHT = 0.5  # [m/s2]
HEIGHT = 0.95  # [m] CoM height where none is known; only the side of a border depends on it


class Motion(NamedTuple):
    """Lateral motion of one trial, each (n,): time [s], x [m], v [m/s], a [m/s2], left and right border [m]; omega [1/s]."""

    time: Array
    x: Array
    v: Array
    a: Array
    left: Array
    right: Array
    omega: float

    def outside(self, position: Array) -> Array:
        """-1 beyond the left border, +1 beyond the right one, 0 between or where unknown; shape (n,)."""
        return np.where(position > self.right, 1, np.where(position < self.left, -1, 0))


class Stretch(NamedTuple):
    """A candidate: first and last instant [s] and what it came from."""

    start: float
    end: float
    source: str


def split(signals: pd.DataFrame, pushes: pd.DataFrame, events: Sequence[Event]) -> pd.DataFrame:
    """Table `loci` of one trial.

    signals: table `signals` of one trial.  pushes: its table `pushes`.  events: [(onset [s], duration [s], type)].
    Empty for tasks outside `TASKS_WITH_LOCI` unless the events name a push, release or locus, and without a CoM.
    """
    wanted = len(signals) and (signals["task"].iloc[0] in TASKS_WITH_LOCI or any(kind in STARTS for _, _, kind in events))
    if not wanted or not signals["com_x"].notna().any():
        return tables.empty("loci")
    motion = _motion(signals)
    windows = list(pushes[["start", "end"]].itertuples(index=False, name=None))
    rows = []
    for stretch in _stretches(motion, pushes, windows, events):
        row = _locus(motion, stretch, _reference(motion, windows, events, stretch.start))
        if row:
            rows.append({k: signals[k].iloc[0] for k in ("trial", "subject", "task", "condition")} | row)
    out = pd.DataFrame([r | {"locus": i} for i, r in enumerate(rows, 1)])
    return out[[c.name for c in tables.TABLES["loci"]]] if rows else tables.empty("loci")


def _motion(signals: pd.DataFrame) -> Motion:
    time = signals["time"].to_numpy(float)
    cutoff = min(CUTOFF, 0.2 / float(np.median(np.diff(time))))
    x = filters.low_pass(signals[["com_x"]].to_numpy(float), time, cutoff)
    v = filters.derivatives(x, time)[0]
    slow = filters.low_pass(signals[["com_x"]].to_numpy(float), time, min(cutoff, CAUGHT_CUTOFF))
    a = filters.derivatives(slow, time)[1]
    left, right = signals["limit_left"].to_numpy(float), signals["limit_right"].to_numpy(float)
    zmp = signals["zmp_x"].to_numpy(float)
    low, high = np.nanpercentile(zmp, [0.5, 99.5]) if np.isfinite(zmp).any() else (-np.inf, np.inf)
    left, right = np.where(np.isfinite(left), left, low), np.where(np.isfinite(right), right, high)
    return Motion(time, x[:, 0], v[:, 0], a[:, 0], left, right, float(np.sqrt(G / _height(signals))))


def _height(signals: pd.DataFrame) -> float:
    height = float(np.nanmean(signals["com_z"])) - float(signals["zmp_z"].median())
    return height if np.isfinite(height) and height > 0.1 else HEIGHT


# -- where loci are ---------------------------------------------------------------------------------------------------


def _stretches(motion: Motion, pushes: pd.DataFrame, windows: Sequence[tuple[float, float]], events: Sequence[Event]) -> list[Stretch]:
    last = float(motion.time[-1])
    bad = [(on, on + long) for on, long, kind in events if kind == "bad"]
    stops = sorted([a for a, _ in windows] + [on for on, _, kind in events if kind == "target"] + [last])

    def stop(start: float) -> float:
        return next((s for s in stops if s > start), last)

    given = [(on, on + long if long > 0 else stop(on)) for on, long, kind in events if kind == "locus"]
    if given:
        found = [Stretch(a, b, "event") for a, b in sorted(given)]
    else:
        starts = [(b, source) for (_, b), source in zip(windows, pushes["source"], strict=True)]
        starts += [(on + long, "event") for on, long, kind in events if kind == "release"]
        if not starts and _away(motion, windows, events):
            starts = [(float(motion.time[0]), "found")]
        found = [Stretch(a, stop(a), source) for a, source in sorted(starts)]
        found = [s for i, s in enumerate(found) if i + 1 == len(found) or found[i + 1].start >= s.end]
    pieces = [p for s in found for p in _without(s, bad)]
    return [p for p in pieces if p.end - p.start >= SHORTEST]


def _away(motion: Motion, windows: Sequence[tuple[float, float]], events: Sequence[Event]) -> bool:
    """Whether a trial starts away from rest."""
    known = np.flatnonzero(np.isfinite(motion.x + motion.v))
    if not len(known):
        return False
    i, rest = known[0], _reference(motion, windows, events, float(motion.time[0]))
    return bool(abs(motion.x[i] - rest) > BAND or abs(motion.v[i]) > 2.0 * SLOW)


def _without(stretch: Stretch, bad: Sequence[tuple[float, float]]) -> list[Stretch]:
    """What is left of a stretch outside the `bad` windows."""
    pieces = [stretch]
    for a, b in bad:
        parts = [q for p in pieces for q in (p._replace(end=min(p.end, a)), p._replace(start=max(p.start, b)))]
        pieces = list(dict.fromkeys(p for p in parts if p.end > p.start))
    return pieces


def _reference(motion: Motion, windows: Sequence[tuple[float, float]], events: Sequence[Event], start: float) -> float:
    """Lateral position [m] the person keeps when nothing happens, between the targets around `start` [s]."""
    targets = sorted(on for on, _, kind in events if kind == "target")
    since = max([t for t in targets if t <= start], default=-np.inf)
    until = min([t for t in targets if t > start], default=np.inf)
    t = motion.time
    within = (t >= since) & (t < until) & np.isfinite(motion.x)
    pushed = np.zeros(len(t), dtype=bool)
    rest = np.zeros(len(t), dtype=bool)
    for a, b in windows:
        pushed |= (t >= a) & (t <= b)
        before = within & (t >= a - REST) & (t < a - 0.05) & ~pushed  # the filter reaches some ms before the onset
        if before.any() and float(np.mean(np.abs(motion.v[before]))) < SLOW:
            rest |= before
    for choice in (rest, within & ~pushed & (np.abs(motion.v) < SLOW), within):
        if choice.any():
            return float(np.median(motion.x[choice]))
    return float(np.nanmedian(motion.x))


# -- what they are ----------------------------------------------------------------------------------------------------


def _locus(motion: Motion, stretch: Stretch, reference: float) -> dict[str, Any] | None:
    inside = (motion.time >= stretch.start - 1e-9) & (motion.time <= stretch.end + 1e-9) & np.isfinite(motion.x)
    if not inside.any():
        return None
    first, last = int(np.flatnonzero(inside)[0]), int(np.flatnonzero(inside)[-1])
    returned = _returned(motion, first, last, reference)
    if not returned:
        last = _caught(motion, first, last)
    if motion.time[last] - motion.time[first] < SHORTEST:
        return None
    offset = motion.x[first : last + 1] - reference
    far = offset[np.nanargmax(np.abs(offset))]
    return {
        "start": float(motion.time[first]), "end": float(motion.time[last]), "start_frame": first, "end_frame": last,
        "kind": _kind(motion, first, last, returned), "side": "right" if far > 0 else "left",
        "source": stretch.source, "reference": reference,
    }  # fmt: skip


def _returned(motion: Motion, first: int, last: int, reference: float) -> bool:
    part = slice(first, last + 1)
    calm = (np.abs(motion.x[part] - reference) <= BAND) & (np.abs(motion.v[part]) <= SLOW)
    time = motion.time[part]
    return any(time[b - 1] - time[a] >= SETTLED for a, b in filters.runs(calm))


def _caught(motion: Motion, first: int, last: int) -> int:
    """Last frame before a CoM outside the support is accelerated inwards."""
    held = motion.outside(motion.x) * motion.a < -CAUGHT
    where = np.flatnonzero(held[first : last + 1])
    return first + int(where[0]) - 1 if len(where) and where[0] > 0 else last


def _kind(motion: Motion, first: int, last: int, returned: bool) -> str:
    leaves = int(motion.outside(motion.x + motion.v / motion.omega)[last])
    if leaves and leaves * motion.v[last] > 0:
        return "falling"
    if returned:
        return "recovering_from_beyond" if motion.outside(motion.x)[first] else "recovering"
    return "unrecovered"


# -- a part -----------------------------------------------------------------------------------------------------------


def of_part(signals: pd.DataFrame, coverage: pd.DataFrame, trials: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `loci` and `pushes` of whole subjects.

    trials: for the events of each file.  coverage: for the body mass.
    """
    events = {t.trial: [tuple(e) for e in json.loads(str(t.events) or "[]")] for t in trials.itertuples()}
    masses = dict(zip(coverage["trial"], coverage["mass"], strict=True))
    loci, pushed = [], []
    for trial, frames in signals.groupby("trial", sort=True, observed=True):
        found = pushes(frames, events[trial], masses[trial])
        pushed.append(found)
        loci.append(split(frames, found, events[trial]))
    return tables.joined("loci", loci), tables.joined("pushes", pushed)
