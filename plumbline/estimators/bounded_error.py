r"""Bounded-error identification of the piecewise-affine law (Bemporad, Garulli, Paoletti, Vicino 2003; 2005, IEEE TAC 50:1567-1580).

All frames shall obey :math:`|p - \varphi'\theta_i| \le \delta` for one of the fewest pieces (MIN PFS).

1. *Greedy*: the largest feasible subset (MAX FS), then the largest of what is left, until less than `SMALLEST` is. Each is sought by
   thermal relaxation (Amaldi and Mattavelli 2002): violated inequalities pull the estimate onto their bound, the less the larger the
   violation and the colder. From random starts it ends at a plane 10 to 16 % too flat, which no refinement mends; here each run
   starts from the affine fit to the neighbours of a random frame.
2. *Refinement*: merge pieces nearer than `ALIKE`, give a piece the frames that only it explains, drop pieces with less than
   `SMALLEST` of them, refit (least squares as projection estimate), until nothing changes.
3. *Assignment*: frames that several pieces explain go with most of their decided neighbours; frames that none explains are rejected.
   Regions follow from linear separation.

One bound cannot suit all pieces: the limits carry the sensor's noise, the law also the feedback's. A bound that covers the noise
(3 sd) does well at 3 mm of feedback noise; at 10 mm the largest feasible subset is a flatter plane that cuts through all three pieces
(k1 -32 and -16 %, two thirds of the switches missed). `WIDTH` below 1 sd finds the pieces at both and rejects a third of the frames.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from plumbline.estimators.pieces import (
    REJECTED,
    Array,
    Frames,
    Labels,
    Local,
    Pieces,
    answer,
    least_squares,
    local_fits,
    named,
    regions,
    thinned,
)

WIDTH = 0.7  # [1] bound over the noise of the noisiest pieces
NEAR = 40  # frames of a local fit
STARTS = 8
CYCLES = 3
MOST = 8  # pieces of the greedy partition
SMALLEST = 0.02  # [1] share of the frames
ALIKE = 0.25  # [1] distance of two pieces over the norm of the smaller
VOTERS = 20
ROUNDS = 40
SETTLED = 1e-4  # [1]
FLOOR = 1e-6  # [m] least bound


def estimate(x: Array, v: Array, p: Array, length: Labels, rate: float, *, seed: int = 0, bound: float | None = None) -> Pieces:
    """The law's pieces by the bounded-error method; `own` is the bound [m].

    x [m], v [m/s], p [m]: CoM, its velocity, measured ZMP, (n, m), padded after length (m,).  rate [Hz] is not used: frames are
    thinned over the plane (`pieces.thinned`).  seed: of the relaxation.  bound: delta [m]; by default `WIDTH` times the 80 % quantile
    of the residual sd of local fits.  Raises ValueError with fewer than 50 frames, or where the bound leaves no piece.
    """
    rng = np.random.default_rng(seed)
    frames = thinned(x, v, p, length)
    fits = local_fits(frames, min(NEAR, len(frames.p)))
    delta = bound or max(FLOOR, WIDTH * float(np.sqrt(np.quantile(fits.variance, 0.8))))
    thetas, labels, rounds = _refined(frames, _greedy(frames, fits, delta, rng), delta)
    labels = _decided(frames, thetas, labels, delta)
    law = named(frames, labels)
    regime = regions(frames, law.side, x, v, length)
    return answer(law, regime, rounds, delta)


def _fit(frames: Frames, here: NDArray[np.bool_]) -> Array:
    return least_squares(frames.unit[here], frames.p[here], np.ones(here.sum()))


def _obeys(frames: Frames, thetas: Array, delta: float) -> NDArray[np.bool_]:
    """Which pieces explain a frame within the bound, (n, s)."""
    return np.asarray(np.abs(frames.p[:, None] - frames.unit @ thetas.T) <= delta)


def _greedy(frames: Frames, fits: Local, delta: float, rng: np.random.Generator) -> Array:
    """thetas (s, 3) of the successive largest feasible subsets, over `unit`."""
    left = np.ones(len(frames.p), bool)
    thetas: list[Array] = []
    while left.sum() > max(SMALLEST * len(left), 8) and len(thetas) < MOST:
        rest = Frames(frames.phi[left], frames.unit[left], frames.p[left])
        theta = _largest_feasible(rest, fits.theta[left], delta, rng)
        here = left & _obeys(frames, theta[None], delta)[:, 0]
        thetas.append(_fit(frames, here) if here.sum() >= 8 else theta)
        left &= ~here
    return np.array(thetas)


def _largest_feasible(frames: Frames, starts: Array, delta: float, rng: np.random.Generator) -> Array:
    """theta (3,) that satisfies the most inequalities of those seen by the relaxation."""
    best: Array = starts[0]
    most = -1
    rows = np.column_stack([frames.unit[:, 1:], frames.p, (frames.unit**2).sum(1)]).tolist()
    for start in rng.integers(len(starts), size=STARTS):
        theta = starts[start]
        for cycle in range(CYCLES + 1):
            count = int(_obeys(frames, theta[None], delta).sum())
            if count > most:
                best, most = theta, count
            if cycle < CYCLES:
                theta = _relaxed([rows[i] for i in rng.permutation(len(rows))], theta, delta, 1 - cycle / CYCLES)
    return best


def _relaxed(rows: list[list[float]], theta: Array, delta: float, heat: float) -> Array:
    """One cycle over all inequalities at temperature heat * delta; plain numbers, as each step needs the last.

    rows: x and x' in `unit`, p [m], squared norm of the regressor; in random order.
    """
    a, b, c = theta.tolist()
    for x, v, p, norm in rows:
        error = p - a - b * x - c * v
        over = abs(error) - delta
        if over > 0:
            step = math.copysign(heat * math.exp(-over / (heat * delta)) * over / norm, error)
            a, b, c = a + step, b + step * x, c + step * v
    return np.array([a, b, c])


def _refined(frames: Frames, thetas: Array, delta: float) -> tuple[Array, Labels, int]:
    """thetas (s, 3), labels (n,) of frames that one piece alone explains, rounds."""
    labels = np.full(len(frames.p), REJECTED)
    rounds = 0
    while rounds < ROUNDS:
        rounds += 1
        obeys = _obeys(frames, thetas, delta)
        pair = _alike(thetas)
        if pair is not None:
            thetas[pair[0]] = _fit(frames, obeys[:, pair[0]] | obeys[:, pair[1]])
            thetas = np.delete(thetas, pair[1], 0)
            continue
        labels = np.where(obeys.sum(1) == 1, obeys.argmax(1), REJECTED)
        counts = np.bincount(labels[labels >= 0], minlength=len(thetas))
        if counts.min() < SMALLEST * len(labels) and len(thetas) > 1:
            thetas = np.delete(thetas, counts.argmin(), 0)
            continue
        new = np.array([_fit(frames, labels == k) for k in range(len(thetas))])
        change = np.linalg.norm(new - thetas, axis=1) / np.linalg.norm(thetas, axis=1)
        thetas = new
        if change.max() < SETTLED:
            break
    return thetas, labels, rounds


def _alike(thetas: Array) -> tuple[int, int] | None:
    """The two pieces most alike, if they are near enough to be one."""
    norm = np.linalg.norm(thetas, axis=1)
    distance = np.linalg.norm(thetas[:, None] - thetas, axis=2) / np.minimum(norm[:, None], norm)
    distance[np.tril_indices(len(thetas))] = np.inf
    i, j = np.unravel_index(distance.argmin(), distance.shape)
    return (int(i), int(j)) if distance[i, j] < ALIKE else None


def _decided(frames: Frames, thetas: Array, labels: Labels, delta: float) -> Labels:
    """Labels with the undecided frames given to the piece, of those that explain them, of most of their decided neighbours."""
    obeys = _obeys(frames, thetas, delta)
    open_, sure = np.flatnonzero(obeys.sum(1) > 1), np.flatnonzero(obeys.sum(1) == 1)
    out = np.where(obeys.sum(1) == 1, obeys.argmax(1), REJECTED)
    if len(open_) and len(sure):
        near = cKDTree(frames.unit[sure, 1:]).query(frames.unit[open_, 1:], min(VOTERS, len(sure)))[1].reshape(len(open_), -1)
        votes = (out[sure][near][:, :, None] == np.arange(len(thetas))).sum(1)
        out[open_] = np.where(obeys[open_], votes, -1).argmax(1)
    return out
