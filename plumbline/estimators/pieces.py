r"""What piecewise-affine identification returns, and the steps its methods share.

A method sorts frames into pieces that carry no names. Here they become the law's (Murai 2013, eq. 4): the piece that explains most of
the ZMP is the law inside the limits, :math:`p = c + k_1 x + k_2 \dot x`; a piece is a limit if a constant fits it better than that law
and next to no ZMP lies beyond it; every other piece is part of the law.

All methods see the frames thinned evenly over the (x, x') plane. Nineteen frames in twenty lie between the limits, most of them quiet
standing near the reference, where the feedback noise moves the body. Thinned evenly in time the methods split that cloud: k-plane
clustering and the bounded error miss 28 to 89 % of the switches. Thinning over the plane also takes away most of the closed-loop bias:
k1 of least squares over the true piece is -0.3 % at 3 mm of feedback noise and -5 % at 10 mm, against -3 % and -25 % over all frames
(omega 2.740, k1 4.038, k2 0.875). What is left at 10 mm none of the methods can remove: all are least squares in a closed loop.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog
from scipy.spatial import cKDTree

Array = NDArray[np.float64]
Regimes = NDArray[np.int8]
Labels = NDArray[np.int64]

PADDING = 2  # regime of frames after the end of a locus
REJECTED = -1  # label of a frame in no piece
CELLS = 40  # cells of the (x, x') plane along each axis
EACH = 8  # frames kept of a cell
FEWEST = 8  # frames of a piece; fewer are noise
BEYOND = 0.005  # [1] largest share of frames that may lie beyond a limit by 3 rms


class Pieces(NamedTuple):
    """The law's three pieces with their certificate.

    constant [m], k1 [1], k2 [s]: p = constant + k1 x + k2 x' inside.  left, right: limits [m], NaN where never reached.
    regime: (n, m), -1 at the left limit, 0 inside, +1 at the right one, `PADDING` after the end.  rounds: iterations done.
    used, rejected: frames the method worked on, and those it put in no piece.  rms: of p minus its piece over the others [m].
    own: the method's own number, which its docstring explains.
    """

    constant: float
    k1: float
    k2: float
    left: float
    right: float
    regime: Regimes
    rounds: int
    used: int
    rejected: int
    rms: float
    own: float

    @property
    def d(self) -> float:
        """Reference position [m], constant/(1 - k1)."""
        return self.constant / (1 - self.k1)


class Frames(NamedTuple):
    """Frames of all loci in a row: phi (n, 3) = (1, x, x') in SI, unit (n, 3) = (1, x, x') in their own mean and spread, p (n,) [m]."""

    phi: Array
    unit: Array
    p: Array


class Local(NamedTuple):
    """Affine fits to the nearest frames of each: theta (n, 3) over `unit`, variance (n,) [m2], (unit' unit)^-1 (n, 3, 3), near (n, c)."""

    theta: Array
    variance: Array
    inverse: Array
    near: Labels


class Law(NamedTuple):
    """theta (3,) = c, k1, k2; limits [m]; side (n,): -1, 0, +1 or `PADDING` where rejected; rms [m]."""

    theta: Array
    left: float
    right: float
    side: Regimes
    rms: float


def thinned(x: Array, v: Array, p: Array, length: Labels) -> Frames:
    """At most `EACH` frames, evenly in time, of each of `CELLS`^2 cells of the (x, x') plane.

    x [m], v [m/s], p [m]: (n, m), padded after length (m,).  Raises ValueError where fewer than 50 frames are left.
    """
    inside = (np.arange(len(x))[:, None] < length).T  # locus by locus
    x, v, p = (one.T[inside] for one in (x, v, p))
    order = np.argsort(_cells(x) * CELLS + _cells(v), kind="stable")
    cell = (_cells(x) * CELLS + _cells(v))[order]
    first = np.searchsorted(cell, cell)
    count = np.maximum(np.searchsorted(cell, cell, side="right") - first, EACH)
    rank = np.arange(len(cell)) - first
    keep = np.sort(order[rank * EACH // count != (rank - 1) * EACH // count])
    if len(keep) < 50:
        raise ValueError(f"{len(keep)} frames are too few for three pieces; 50 are needed")
    phi = np.column_stack([np.ones(len(keep)), x[keep], v[keep]])
    mean, spread = np.append(0.0, phi[:, 1:].mean(0)), np.append(1.0, phi[:, 1:].std(0))
    return Frames(phi, (phi - mean) / spread, p[keep])


def _cells(y: Array) -> Labels:
    low, high = np.quantile(y, [0.001, 0.999])
    return np.asarray(np.clip((y - low) / (high - low) * CELLS, 0, CELLS - 1), np.int64)


def local_fits(frames: Frames, c: int) -> Local:
    """Least squares over each frame and its c - 1 nearest in the plane (Ferrari-Trecate 2003, local data sets)."""
    near = cKDTree(frames.unit[:, 1:]).query(frames.unit[:, 1:], c)[1]
    a, p = frames.unit[near], frames.p[near]
    inverse = np.linalg.inv(np.einsum("nci,ncj->nij", a, a) + 1e-10 * np.eye(3))
    theta = np.einsum("nij,ncj,nc->ni", inverse, a, p)
    variance = ((p - np.einsum("nci,ni->nc", a, theta)) ** 2).sum(1) / (c - 3)
    return Local(theta, variance, inverse, near)


def least_squares(phi: Array, p: Array, weight: Array) -> Array:
    """theta (k,) of p = phi theta, rows weighted by weight (n,)."""
    root = np.sqrt(weight)
    return np.asarray(np.linalg.lstsq(phi * root[:, None], p * root, rcond=None)[0])


# -- names ------------------------------------------------------------------------------------------------------------


def named(frames: Frames, labels: Labels, weight: Array | None = None) -> Law:
    """Which piece is the law, which a limit; both fitted by weighted least squares, a limit as a constant.

    labels: (n,) number of the piece of each frame or `REJECTED`.  weight: (n,) of the frames, default 1.  Raises ValueError where no
    piece has `FEWEST` frames.
    """
    w = np.ones(len(labels)) if weight is None else weight
    kept = [k for k in range(int(labels.max()) + 1) if (labels == k).sum() >= FEWEST]
    if not kept:
        raise ValueError(f"no piece has {FEWEST} frames")
    law, theta = _steepest(frames, labels, kept, w)
    side = np.where(np.isin(labels, kept), 0, PADDING).astype(np.int8)
    middle = float(np.median(frames.p[labels == law]))
    for k in kept:
        here = labels == k
        if k != law and _is_limit(frames, here, theta):
            side[here] = -1 if frames.p[here].mean() < middle else 1
    theta = least_squares(frames.phi[side == 0], frames.p[side == 0], w[side == 0])
    left, right = (float(np.average(frames.p[side == s], weights=w[side == s])) if (side == s).any() else np.nan for s in (-1, 1))
    used = side != PADDING
    error = (frames.p - np.select([side == -1, side == 1], [left, right], frames.phi @ theta))[used]
    return Law(theta, left, right, side, float(np.sqrt(np.mean(error**2))))


def _steepest(frames: Frames, labels: Labels, kept: list[int], weight: Array) -> tuple[int, Array]:
    """The piece with the largest sum of squares explained by its affine fit, and that fit."""
    fits = {}
    for k in kept:
        here = labels == k
        fits[k] = least_squares(frames.phi[here], frames.p[here], weight[here])
    best = max(kept, key=lambda k: (labels == k).sum() * np.var(frames.phi[labels == k] @ fits[k]))
    return best, fits[best]


def _is_limit(frames: Frames, here: NDArray[np.bool_], theta: Array) -> bool:
    p = frames.p[here]
    mean, rms = p.mean(), p.std()
    if rms**2 >= np.mean((p - frames.phi[here] @ theta) ** 2):
        return False
    reach = 3 * rms + 1e-9  # [m] rounding of noise-free frames
    return bool(min(np.mean(frames.p < mean - reach), np.mean(frames.p > mean + reach)) <= BEYOND)


def answer(law: Law, regime: Regimes, rounds: int, own: float) -> Pieces:
    """A method's result from its named pieces."""
    c, k1, k2 = map(float, law.theta)
    rejected = int((law.side == PADDING).sum())
    return Pieces(c, k1, k2, law.left, law.right, regime, rounds, len(law.side), rejected, law.rms, own)


# -- regions ----------------------------------------------------------------------------------------------------------


def regions(frames: Frames, side: Regimes, x: Array, v: Array, length: Labels) -> Regimes:
    """Regime of every frame, (n, m), by a line in the (x, x') plane between each limit's sorted frames and the law's."""
    out = np.zeros(x.shape, np.int8)
    for limit in (-1, 1):
        if (side == limit).any():
            a = separating_line(frames.phi, side == limit, side == 0)
            out[a[0] + a[1] * x + a[2] * v > 0] = limit
    return padded(out, length)


def separating_line(phi: Array, yes: NDArray[np.bool_], no: NDArray[np.bool_]) -> Array:
    """a (3,) with phi a > 0 on `yes` and < 0 on `no` at the least mean violation (Bennett and Mangasarian 1992, robust LP)."""
    spread = np.append(1.0, phi[:, 1:].std(0))
    rows = np.vstack([phi[yes], -phi[no]]) / spread
    n = len(rows)
    cost = np.repeat([0.0, 1 / yes.sum(), 1 / no.sum()], [3, yes.sum(), no.sum()])
    bounds = [(None, None)] * 3 + [(0, None)] * n
    got = linprog(cost, sparse.hstack([-rows, -sparse.eye(n)]).tocsr(), -np.ones(n), bounds=bounds, method="highs")
    return np.asarray(got.x[:3] / spread)


def padded(regime: Regimes, length: Labels) -> Regimes:
    """The regime with `PADDING` after the end of each locus."""
    out = regime.copy()
    out[np.arange(len(out))[:, None] >= length] = PADDING
    return out
