r"""Pushes: windows in which an unmeasured force acts on the person.

From the events file where it names pushes. Else from the force balance :math:`F_{ex} = m \ddot x - F`, for each horizontal axis
for itself: the CoM's acceleration holds every force, the plates only theirs. A window counts as a push where

1. :math:`|F_{ex}|`, low-passed at 6 Hz and without its median, exceeds six times its robust scale (median absolute value times
   1.48, which a few short pushes in a trial do not move);
2. it lasts 40 ms to 1 s between the instants where it rises above and falls below 15 % of its peak (a contact that stays for
   longer, such as a seat, is no push and is left for the residuals to show);
3. it changes the momentum: its impulse is at least m x 2 cm/s and at least 60 % of the impulse of its size, taken with 0.15 s on
   each side. Soft tissue that swings after a heel strike takes back what it gave;
4. such windows are rare: an axis with more than one in two seconds on average has a misfit of another kind, and gives none.

Windows of both axes that overlap or lie less than 0.1 s apart are one push. Without shear forces or without a CoM of its own (one
made from the forces balances them by definition) none can be found.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import filters, tables

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Event = tuple[float, float, str]  # onset [s], duration [s], trial_type

CUTOFF = 6.0  # [Hz] of the force balance
HIGH = 6.0  # [1] robust scales a push must exceed
EDGE = 0.15  # [1] share of the peak at which a push begins and ends
LOW = 2.5  # [1] robust scales below which an edge is noise
SHORTEST, LONGEST = 0.04, 1.0  # [s]
BESIDE = 0.15  # [s] on each side for the net impulse
KICK = 0.02  # [m/s] least change of the CoM's velocity
ONE_WAY = 0.6  # [1] net impulse over the impulse of the size
RARE = 0.5  # [1/s] most windows per second
APART = 0.1  # [s]
NORMAL = 1.4826  # [1] scale of a normal variable over its median absolute value


def pushes(signals: pd.DataFrame, events: Sequence[Event], mass: float) -> pd.DataFrame:
    """Table `pushes` of one trial, in the order of time.

    signals: table `signals` of one trial.  events: [(onset [s], duration [s], type)], in the file's own time.  mass: [kg].
    Where the events name any push, these are the pushes; else they are found.
    """
    if not len(signals):
        return tables.empty("pushes")
    time = signals["time"].to_numpy(float)
    outside = external_force(signals, mass)
    size = np.linalg.norm(outside, axis=1)
    named = sorted((on, on + last) for on, last, kind in events if kind == "push")
    windows = named or _merged([w for k in (0, 1) for w in _found(outside[:, k], time, mass)])
    rows = [{"start": a, "end": b, "source": "event" if named else "found", "peak": _peak(size, time, a, b)} for a, b in windows]
    key = {k: signals[k].iloc[0] for k in ("trial", "subject", "task", "condition")}
    return pd.DataFrame([key | r for r in rows]) if rows else tables.empty("pushes")


def external_force(signals: pd.DataFrame, mass: float) -> Array:
    """Horizontal force [N] that the plates do not measure, (n, 2): m x'' - F, both low-passed, without its median.

    NaN without mass, shear or an independent CoM.
    """
    time = signals["time"].to_numpy(float)
    com = signals[["com_x", "com_y"]].to_numpy(float)
    grf = signals[["grf_x", "grf_y"]].to_numpy(float)
    made_of_force = not signals[["com_table_x", "com_lab_x"]].notna().to_numpy().any()
    if made_of_force or not np.isfinite(mass) or not np.isfinite(com + grf).any() or len(time) < 2:
        return np.full((len(time), 2), np.nan)
    cutoff = min(CUTOFF, 0.2 / float(np.median(np.diff(time))))
    acceleration = filters.derivatives(filters.low_pass(com, time, cutoff), time)[1]
    out = mass * acceleration - filters.low_pass(grf, time, cutoff)
    good = filters.known(com + grf)
    out[filters.edges(good, 1.0 / float(np.median(np.diff(time))), cutoff)] = np.nan
    known = filters.known(out)
    return np.asarray(out - np.median(out[known], axis=0)) if known.any() else out


def _found(force: Array, time: Array, mass: float) -> list[tuple[float, float]]:
    """Windows [s] on one axis.  force: external, [N], shape (n,)."""
    size = np.abs(force)
    known = np.isfinite(size)
    if not known.any():
        return []
    scale = NORMAL * float(np.median(size[known]))
    spans = [(a, b, max(EDGE * float(size[a:b].max()), LOW * scale)) for a, b in filters.runs(size > HIGH * scale)]
    windows = {_widen(size, a, b, floor) for a, b, floor in spans}
    out = [w for w in windows if SHORTEST <= time[w[1]] - time[w[0]] <= LONGEST and _kicks(force, time, *w, mass)]
    rare = len(out) <= max(1.0, RARE * float(time[-1] - time[0]))
    return [(float(time[a]), float(time[b])) for a, b in out] if rare else []


def _widen(size: Array, a: int, b: int, floor: float) -> tuple[int, int]:
    """First and last frame around [a, b) in which the size stays above `floor`."""
    below = ~(size > floor)
    before, after = np.flatnonzero(below[:a]), np.flatnonzero(below[b:])
    return (int(before[-1]) + 1 if len(before) else 0), (b + int(after[0]) - 1 if len(after) else len(size) - 1)


def _kicks(force: Array, time: Array, start: int, end: int, mass: float) -> bool:
    """Whether the force in the window, with its neighbourhood, changes the momentum for good."""
    near = (time >= time[start] - BESIDE) & (time <= time[end] + BESIDE)
    inside = np.nan_to_num(force[near])
    step = float(np.median(np.diff(time)))
    net, whole = abs(float(inside.sum())) * step, float(np.abs(inside).sum()) * step
    return net >= KICK * mass and net >= ONE_WAY * whole


def _merged(windows: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Windows that overlap or lie less than `APART` apart made one."""
    out: list[tuple[float, float]] = []
    for a, b in sorted(windows):
        if out and a <= out[-1][1] + APART:
            out[-1] = out[-1][0], max(b, out[-1][1])
        else:
            out.append((a, b))
    return out


def _peak(size: Array, time: Array, start: float, end: float) -> float:
    inside = size[(time >= start) & (time <= end)]
    return float(np.nanmax(inside)) if np.isfinite(inside).any() else float("nan")
