"""Which foot is off the ground and which plate stands empty: from the feet's markers; without those, from the load alone.

A foot that merely bears little stays on its plate: what the plate reads then is its load, and it belongs into the net wrench.
What an empty plate reads is its zero error (-27 to +48 N were seen) and would move the net CoP.

- A foot is *off* where all its markers are more than 3 cm above their resting height (each marker's 5th percentile over the
  trial), or all move faster than its usual slow speed (20th percentile, so that a treadmill's belt counts as rest) by 0.5 m/s.
- With foot markers a plate is *free* where it reads less than 80 N and the foot assigned to it (else each foot) is off or beside
  it: more than 0.1 m from its corners' box, without corners more than 0.3 m from the box that holds 98 % of its CoP. Its median
  reading there, over 0.3 s or more, is its zero error (else 0 N), and it is *empty* where it is free and within 3 N, or 4 standard
  deviations, of that; while a foot comes or goes the small load counts.
- Without, a light foot cannot be told from a zero error, and the wrench is kept. Only where the file starts or ends with the
  plate light and steady (80 % of 0.3 s or more within 1 N) that level is taken as its zero error, and the plate as empty in each
  light stretch of 0.3 s or more while it reads within 3 N of it.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from plumbline import feet
from plumbline.filters import runs
from plumbline.loads import LOADED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIFT = 0.03  # [m] above its resting height a marker is lifted
SWING = 0.5  # [m/s] above its slow speed a marker moves
WINDOW = 0.05  # [s] over which the speed is taken: noise of 1 mm gives 0.03 m/s
BESIDE_CORNERS = 0.1  # [m] a foot reaches this far beyond its markers
BESIDE_COP = 0.3  # [m] the same, and a plate reaches beyond the CoP it has seen
EMPTY = 0.3  # [s] a shorter light stretch does not show a zero error
STEADY = 1.0  # [N] change of a zero error within a stretch
SAME = 3.0  # [N] between stretches
SPREAD = 4.0  # [1] standard deviations
SMOOTH = 0.1  # [s] over which the load is averaged to see it


class Foot(NamedTuple):
    """points: a foot's markers [m], (n, k, 3).  off: frames in which it is seen to be off the ground, (n,)."""

    points: Array
    off: Mask


class Area(NamedTuple):
    """Where a plate is, horizontally [m]: low and high corner of a box, each (2,), and how far a foot beside it is from that."""

    low: Array
    high: Array
    margin: float

    def beside(self, points: Array) -> Mask:
        """Frames in which all points seen (n, k, 3) are farther than the margin; False where none is seen."""
        xy = points[..., :2]
        apart = np.linalg.norm(np.maximum(np.maximum(self.low - xy, xy - self.high), 0.0), axis=2)
        return np.asarray(np.fmin.reduce(apart, axis=1) > self.margin)


def area(corners: Array | None, cop: Array) -> Area | None:
    """Area of a plate from its corners (4, 3), else from its CoP (k, 3), NaN where unloaded; None without both."""
    if corners is not None:
        return Area(corners[:, :2].min(axis=0), corners[:, :2].max(axis=0), BESIDE_CORNERS)
    seen = cop[np.isfinite(cop[:, 0]), :2]
    if not len(seen):
        return None
    low, high = np.percentile(seen, [1, 99], axis=0)
    return Area(low, high, BESIDE_COP)


def of_feet(markers: Mapping[str, Array], outline: Mapping[str, Array], time: Array) -> dict[str, Foot]:
    """Each foot whose markers are seen, by side.

    markers: label -> (n, 3) [m]; a foot's are those low ones that name its side.  outline: side -> (n, k, 3), used where no label
    names a side.  time: [s], (n,).
    """
    found = {**outline, **feet.groups(markers)}
    return {side: Foot(points, _lifted(points) | _moving(points, time)) for side, points in found.items()}


def _lifted(points: Array) -> Mask:
    z = points[..., 2]
    return np.asarray(np.fmin.reduce(z - np.nanpercentile(z, 5, axis=0), axis=1) > LIFT)


def _moving(points: Array, time: Array) -> Mask:
    n = len(time)
    if n < 3:
        return np.zeros(n, dtype=bool)
    half = max(1, round(0.5 * WINDOW / float(np.median(np.diff(time)))))
    a, b = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half, n - 1)
    speed = np.linalg.norm(points[b, :, :2] - points[a, :, :2], axis=2) / (time[b] - time[a])[:, None]
    slowest = np.fmin.reduce(speed, axis=1)
    known = slowest[np.isfinite(slowest)]
    return np.asarray(slowest - np.percentile(known, 20) > SWING) if len(known) else np.zeros(n, dtype=bool)


def empty(load: Array, light: Mask, standing: Sequence[Foot], where: Area | None, time: Array) -> Mask:
    """Frames in which nobody is on a plate (see module).

    load: vertical [N], (n,).  light: too little for a CoP, (n,).  standing: the feet that may be on it; none: judged by its load.
    """
    if not standing:
        return _at_zero(load, light, time)
    free = load < LOADED
    for foot in standing:
        free &= foot.off | (where.beside(foot.points) if where else False)
    level = spread = 0.0
    if free.sum() * float(np.median(np.diff(time))) >= EMPTY:
        level = float(np.median(load[free]))
        spread = 1.4826 * float(np.median(np.abs(load[free] - level)))
    return np.asarray(free & (np.abs(load - level) < max(SAME, SPREAD * spread)))


def _at_zero(load: Array, light: Mask, time: Array) -> Mask:
    """Light frames at the level that the plate has, light and steady, at an end of the file."""
    out = np.zeros(len(load), dtype=bool)
    long = [(a, b) for a, b in runs(light) if time[b - 1] - time[a] >= EMPTY]
    if not long:
        return out
    width = max(1, round(SMOOTH / float(np.median(np.diff(time)))))
    smooth = {(a, b): uniform_filter1d(load[a:b], width, mode="nearest") for a, b in long}
    ends = [smooth[a, b] for a, b in long if a == 0 or b == len(load)]
    levels = [np.median(s) for s in ends if np.mean(np.abs(s - np.median(s)) < STEADY) > 0.8]
    for (a, b), s in smooth.items():
        for level in levels:
            out[a:b] |= np.abs(s - level) < SAME
    return out
