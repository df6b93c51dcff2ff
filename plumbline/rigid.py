r"""Points that go with a rigid piece of the body, such as the navel with the pelvis.

Where such a point lies is told at the trial's upright moment, when the trunk is straight; from there the markers on its piece carry
it. The turn :math:`R` from the piece's shape :math:`a_k` to a frame's markers :math:`b_k` is the one that leaves least,

.. math:: \min_R \sum_k | R (a_k - \bar a) - (b_k - \bar b) |^2

from the singular value decomposition of :math:`\sum_k (b_k - \bar b)(a_k - \bar a)^\top`.
Soederkvist I, Wedin P-A (1993) J Biomech 26:1473-1477.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.filters import known

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CARRIERS = 3  # markers that must be seen in a frame: fewer do not tell a turn
SPREAD = 0.01  # [m] by which the seen markers must stand off a line, root of the sum of squares
HIGH = 0.1  # [1] of the line's length by which its upper end may be below its highest: standing, not sitting straight
STRAIGHTEST = 0.05  # [1] of the frames that high are the upright moment
LEANS = 20.0  # [deg] beyond which nobody stands upright


class Upright(NamedTuple):
    """The frames of the upright moment, in time order, and how far the line leans there at most [deg]."""

    frames: NDArray[np.int_]
    lean: float


def upright(start: Array, end: Array) -> Upright | None:
    """When a line is upright: where its end is as high as it comes, the frames in which it is nearest the vertical.

    Height is asked for first because a person who sits straight bends the back; there is no telling it from the line alone.
    start, end: ends of the line [m], shape (n, 3), z up.  None where the line is never seen.
    """
    line = end - start
    length = np.linalg.norm(line, axis=1)
    there = np.flatnonzero(known(line) & (length > 0.0))
    if not len(there):
        return None
    height = end[there, 2]
    high = there[height >= height.max() - HIGH * float(np.median(length[there]))]
    lean = np.degrees(np.arccos(np.clip(np.abs(line[high, 2]) / length[high], 0.0, 1.0)))
    best = np.argsort(lean, kind="stable")[: max(1, round(STRAIGHTEST * len(high)))]
    return Upright(np.sort(high[best]), float(lean[best].max()))


def carry(point: Array, markers: Array, frames: NDArray[np.int_]) -> Array:
    """A point that the markers carry as it lies to them in `frames` on average, shape (n, 3).

    point: [m], shape (n, 3), read in `frames` only.  markers: [m], shape (n, k, 3), all seen in `frames`.  NaN in a frame in which
    fewer than `CARRIERS` markers are seen, or those on one line.
    """
    first = markers[frames[0]][None]
    piece = np.concatenate([markers[frames], point[frames][:, None]], axis=1)
    shape = _apply(_motion(markers[frames], first), piece).mean(axis=0)
    return _apply(_motion(shape[None, :-1], markers), shape[None, -1:])[:, 0]


class _Motion(NamedTuple):
    turn: Array  # (n, 3, 3)
    before: Array  # (n, 1, 3) mean of the seen markers before ...
    after: Array  # (n, 1, 3) ... and after


def _motion(a: Array, b: Array) -> _Motion:
    """The rigid motion from markers a to b [m], shapes (n or 1, k, 3); NaN where they do not tell one."""
    a, b = np.broadcast_arrays(a, b)
    seen = known(a + b)
    w = (seen / np.maximum(seen.sum(axis=1, keepdims=True), 1))[..., None]
    a, b = np.where(seen[..., None], a, 0.0), np.where(seen[..., None], b, 0.0)
    before, after = (w * a).sum(axis=1, keepdims=True), (w * b).sum(axis=1, keepdims=True)
    u, s, vt = np.linalg.svd(np.einsum("nki,nkj->nij", seen[..., None] * (b - after), a - before))
    u[:, :, 2] *= np.sign(np.linalg.det(u @ vt))[:, None]  # a turn, no mirror image
    turn = np.where((s[:, 1] > SPREAD**2)[:, None, None], u @ vt, np.nan)
    turn[seen.sum(axis=1) < CARRIERS] = np.nan
    return _Motion(turn, before, after)


def _apply(motion: _Motion, points: Array) -> Array:
    return np.asarray(np.einsum("nij,nkj->nki", motion.turn, points - motion.before) + motion.after)
