r"""Joint least squares of the clipped law over all loci: gains and both limits together (Murai 2013, eq. 4).

.. math:: \min \sum \bigl(p - \mathrm{clip}(c + k_1 x + k_2 \dot x,\, x_{Z,L},\, x_{Z,R})\bigr)^2, \qquad c = (1 - k_1)\, d

A frame belongs to a limit where the LAW asks for more, not where the noisy ZMP lies there. Feedback noise runs through the plant
into x and x', so the gains are too small (3 % at 3 mm of noise, a quarter at 10 mm); the limits are not touched by that. The gains
start the consistent estimators.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import Batch
from plumbline.estimators.clustered import jackknife
from plumbline.models.controller import Law

Array = NDArray[np.float64]

LONG_ENOUGH = 0.15  # [s] in all that the law must ask for more than a limit, and the ZMP stay there, before it is one
ROUNDS = 60


class Saturation(NamedTuple):
    """law; sum of squares [m2]; covariance of (d, k1, k2) by locus (3, 3); rms of p - law inside and at the limits [m]; loci."""

    law: Law
    cost: float
    covariance: Array
    inside_rms: float
    limit_rms: float
    loci: int


def fit(batch: Batch) -> Saturation | None:
    """Fit the clipped law by alternating between who is clipped and least squares of each piece.

    None where x and x' do not vary enough to tell two gains (fewer than 20 frames inside).
    """
    here = batch.inside
    x, v, p = batch.x[here], batch.v[here], batch.p[here]
    if len(p) < 20:
        return None
    best = None
    for share in (0.0, 0.01, 0.05, 0.15):  # starts that differ in how much of the ZMP's range is called clipped
        left, right = (float(q) for q in np.quantile(p, [share, 1 - share])) if share else (-np.inf, np.inf)
        got = _alternate(x, v, p, left, right, round(LONG_ENOUGH * batch.rate))
        if got is not None and (best is None or _cost(got, x, v, p) < _cost(best, x, v, p)):
            best = got
    return None if best is None else _certified(best, batch)


def _alternate(x: Array, v: Array, p: Array, left: float, right: float, enough: int) -> Law | None:
    margin = 0.05 * (right - left) if np.isfinite(right - left) else 0.0
    inside = (p > left + margin) & (p < right - margin) if margin else np.ones(len(p), bool)
    law = None
    for _ in range(ROUNDS):
        solved = linear(x[inside], v[inside], p[inside])
        if solved is None:
            return law
        c, k1, k2 = solved
        wanted = c + k1 * x + k2 * v
        left = _limit(p, wanted <= left, enough, -1)
        right = _limit(p, wanted >= right, enough, +1)
        law = Law(_reference(c, k1), k1, k2, left, right)
        again = (wanted > left) & (wanted < right)
        if np.array_equal(again, inside):
            break
        inside = again
    return law


def linear(x: Array, v: Array, p: Array) -> tuple[float, float, float] | None:
    """Least squares of p = c + k1 x + k2 x': (c [m], k1 [1], k2 [s]); None where fewer than 20 frames, or x and x' cannot be told apart.

    x, v, p: (n,).  Centred and scaled normal equations: their condition is that of the correlation of x with x'.
    """
    if len(p) < 20:
        return None
    middle = np.array([x.mean(), v.mean(), p.mean()])
    a, b, y = x - middle[0], v - middle[1], p - middle[2]
    size = np.sqrt([a @ a, b @ b])
    if size.min() <= 1e-9 * np.sqrt(len(p)) or 1 - (a @ b / size.prod()) ** 2 < 1e-6:
        return None
    k1, k2 = np.linalg.solve([[a @ a, a @ b], [a @ b, b @ b]], [a @ y, b @ y])
    return float(middle[2] - k1 * middle[0] - k2 * middle[1]), float(k1), float(k2)


def _reference(c: float, k1: float) -> float:
    return float(c / (1 - k1)) if abs(1 - k1) > 1e-6 else float("nan")


def _limit(p: Array, clipped: NDArray[np.bool_], enough: int, side: int) -> float:
    """Mean ZMP over the frames clipped on one side; infinite where they are too few to be a limit."""
    return float(p[clipped].mean()) if clipped.sum() >= enough else side * np.inf


def _cost(law: Law, x: Array, v: Array, p: Array) -> float:
    error = p - law.zmp(x, v)
    return float(error @ error)


def _certified(law: Law, batch: Batch) -> Saturation:
    """Covariance and sizes of the residual for a fitted law."""
    here = batch.inside
    error = np.where(here, batch.p - law.zmp(batch.x, batch.v), 0.0)
    region = law.region(batch.x, batch.v)
    free = here & (region == 0)
    columns = np.stack([np.full(batch.x.shape, 1 - law.k1), batch.x - law.d, batch.v]) * free
    normals = np.einsum("inm,jnm->mij", columns, columns)[free.any(0)]
    scores = np.einsum("inm,nm->mi", columns, error)
    scores = scores[free.any(0)]
    return Saturation(
        law,
        float(np.sum(error**2)),
        jackknife(normals, scores),
        _robust_rms(error[free]),
        _robust_rms(error[here & (region != 0)]),
        len(scores),
    )


def _robust_rms(error: Array) -> float:
    """Standard deviation from the median of |e|: single wrong frames do not count; NaN without frames."""
    return float(np.median(np.abs(error)) / 0.6745) if len(error) else float("nan")
