"""Loci of one subject, task and condition as a batch for the identification of the controller."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import batch
from plumbline.batch import LEAD, Batch
from plumbline.plant import PUSH_MARGIN, rows_of, sampling_rate

Array = NDArray[np.float64]

HORIZON = 5.0  # [s] of a locus that is used: later the person sways, and noise alone moves the CoM
SHORTEST = 0.3  # [s] of a locus without a gap
FASTEST = 200.0  # [Hz] to which faster recordings are interpolated
PAST_BEND = 6.0  # [Hz] smoother of the motion before a locus, in which somebody may push
REGIMES = {"left": -1, "inside": 0, "right": 1}  # at the left limit, at none, at the right one


class Key(NamedTuple):
    """What makes a group."""

    subject: str
    task: str
    condition: str


@dataclass(frozen=True)
class Group:
    """Loci of one subject, task and condition that have an unbroken CoM and ZMP.

    loci: their rows of the table, in the order of the batch's columns.  starts: time of each one's first frame [s], shape (m,).
    left_out: (row of the table, why not).  shortened: what each locus lost to a gap, in words; empty where nothing, length m.
    """

    subject: str
    task: str
    condition: str
    loci: pd.DataFrame
    starts: Array
    batch: Batch
    left_out: Sequence[tuple[pd.Series, str]]
    shortened: Sequence[str]

    @property
    def steady(self) -> NDArray[np.bool_]:
        """Loci that do not fall, shape (m,)."""
        return (self.loci["kind"] != "falling").to_numpy()


def by_group(loci: pd.DataFrame) -> Iterator[tuple[Key, pd.DataFrame]]:
    """Rows of `loci`, or of another table with a subject, task and condition, group by group in the order of their names."""
    for key, mine in loci.groupby(list(Key._fields), sort=True, observed=True):
        yield Key(*map(str, key)), mine


def of_loci(signals: pd.DataFrame, pushes: pd.DataFrame, loci: pd.DataFrame, omega: Mapping[Key, float]) -> Iterator[Group]:
    """Groups of whole subjects.

    signals, pushes, loci: tables; a locus is used from PUSH_MARGIN after the push that it follows.
    omega: natural frequency that smooths a group's loci [rad/s]; groups without one are left out.
    """
    rows = signals.groupby("trial", sort=True, observed=True).indices
    for key, mine in by_group(loci):
        if key in omega:
            frames = {trial: rows_of(signals, rows[trial]) for trial in mine["trial"].unique() if trial in rows}
            group = _group(key, mine, _first_used(mine, pushes), frames, omega[key])
            if group is not None:
                yield group


def regimes(group: Group, trust: pd.DataFrame) -> NDArray[np.int8] | None:
    """REGIMES of each frame of a group's batch, (n, m), from the table `trust`; None where a locus has none there."""
    out = np.zeros(group.batch.x.shape, np.int8)
    parts = dict(tuple(trust.groupby(["trial", "locus"], observed=True)))
    for j, (trial, locus) in enumerate(zip(group.loci["trial"], group.loci["locus"], strict=True)):
        mine = parts.get((trial, locus))
        if mine is None:
            return None
        time = group.starts[j] + (np.arange(len(out)) - group.batch.lead) / group.batch.rate
        part = np.searchsorted(mine["start"].to_numpy(), time + 1e-9, side="right") - 1
        out[:, j] = mine["regime"].map(REGIMES).to_numpy()[np.maximum(part, 0)]
    return out


def _first_used(loci: pd.DataFrame, pushes: pd.DataFrame) -> Array:
    """Instant from which each locus is used [s], shape (m,): hands leave a little after the marks."""
    ends = {trial: one["end"].to_numpy(float) for trial, one in pushes.groupby("trial", observed=True)}
    out = loci["start"].to_numpy(float).copy()
    for j, trial in enumerate(loci["trial"]):
        free = ends.get(trial, np.empty(0)) + PUSH_MARGIN
        out[j] = max([out[j], *free[(free > out[j]) & (free <= out[j] + PUSH_MARGIN + 1e-9)]])
    return out


def _group(key: Key, loci: pd.DataFrame, start: Array, frames: dict[Any, pd.DataFrame], omega: float) -> Group | None:
    motions = {trial: _Motion.of(table) for trial, table in frames.items()}
    if not motions:
        return None
    rate = min(float(np.median([m.rate for m in motions.values()])), FASTEST)
    cut, kept, left_out, shortened = [], [], [], []
    for (_, locus), begin in zip(loci.iterrows(), start, strict=True):
        piece = motions[locus["trial"]].cut(begin, locus["end"], rate) if locus["trial"] in motions else None
        if piece is None or len(piece[0]) < max(SHORTEST * rate, 8):
            left_out.append((locus, f"no unbroken CoM and ZMP of {SHORTEST} s"))
        else:
            cut.append(piece)
            kept.append(locus)
            first, last = piece[3], piece[3] + (len(piece[0]) - 1) / rate
            whole = first <= begin + 1.5 / rate and last >= min(locus["end"], begin + HORIZON) - 1.5 / rate
            shortened.append("" if whole else f"a gap: only {first:.2f} to {last:.2f} s is used")
    if not cut:
        return None
    made = batch.of_loci([c[0] for c in cut], [c[1] for c in cut], omega, rate, [c[2] for c in cut])
    return Group(*key, pd.DataFrame(kept).reset_index(drop=True), np.array([c[3] for c in cut]), made, left_out, shortened)


@dataclass(frozen=True)
class _Motion:
    """One trial: time [s], unfiltered CoM and ZMP [m], each (n,); rate [Hz]."""

    time: Array
    x: Array
    p: Array
    rate: float

    @classmethod
    def of(cls, table: pd.DataFrame) -> "_Motion":
        """Of a trial's rows of `signals`."""
        time, x, p = (table[c].to_numpy(float) for c in ("time", "com_x", "zmp_x"))
        return cls(time, x, p, sampling_rate(time))

    def cut(self, start: float, end: float, rate: float) -> tuple[Array, Array, tuple[Array, Array], float] | None:
        """CoM, ZMP, the past (position, velocity) of a locus at `rate`, and its first instant; up to its first gap."""
        first, last = np.searchsorted(self.time, [start - 1e-9, min(end, start + HORIZON) + 1e-9])
        good = np.isfinite(self.x[first:last] + self.p[first:last])
        if not good.any():
            return None
        first += int(np.argmax(good))
        gap = np.flatnonzero(~np.isfinite(self.x[first:last] + self.p[first:last]))
        last = first + int(gap[0]) if len(gap) else last
        if last - first < 2:
            return None
        t = np.arange(self.time[first], self.time[last - 1] + 0.5 / rate, 1 / rate)
        t = t[t <= self.time[last - 1] + 1e-9]
        x, p = (np.interp(t, self.time[first:last], one[first:last]) for one in (self.x, self.p))
        return x, p, self._past(int(first), rate), float(self.time[first])

    def _past(self, first: int, rate: float) -> tuple[Array, Array]:
        """Position and velocity in the LEAD before frame `first`, as far back as there is no gap."""
        begin = max(0, first - round(2 * LEAD * self.rate))
        gap = np.flatnonzero(~np.isfinite(self.x[begin:first]))
        begin += int(gap[-1]) + 1 if len(gap) else 0
        end = min(len(self.x), first + round(LEAD * self.rate))
        after = np.flatnonzero(~np.isfinite(self.x[first:end]))
        end = first + int(after[0]) if len(after) else end
        if first - begin < 2 or end - begin < 8:
            return np.empty(0), np.empty(0)
        slow = batch.slow(self.x[begin:end], self.rate, PAST_BEND)
        speed = np.gradient(slow, self.time[begin:end])
        when = self.time[first] - np.arange(min(round(LEAD * rate), int((first - begin) * rate / self.rate)), 0, -1) / rate
        return np.interp(when, self.time[begin:end], slow), np.interp(when, self.time[begin:end], speed)
