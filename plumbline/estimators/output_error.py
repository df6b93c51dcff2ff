r"""Output error: the gains with which the simulated closed loop follows the measured CoM.

Only the deviation from the measured motion is simulated, so that nothing the plant lacks counts against the controller:

.. math:: \delta\ddot x = \omega^2 (\delta x - \delta p), \qquad
    \delta p = \mathrm{clip}\bigl(\mathrm{law}(x + \delta x,\, \dot x + \delta\dot x)\bigr) - p,

from rest at the start of each locus (no start state is fitted), state taken `delay` earlier. Where law and measured ZMP are both at
the same limit :math:`\delta p = 0`: half a millimetre of a limit would grow as e^(wt). The outputs are the CoM and the ZMP,

.. math:: \min \sum (\delta x/\sigma_x)^2 + (\delta p/\sigma_p)^2,

each in its own rms (Levenberg 1944, Marquardt 1963): the CoM alone hardly tells a delay from larger gains, the ZMP shows when the law
acts. Feedback noise reaches the outputs but not the simulated regressors: unlike least squares the estimate is consistent
(Ljung 1999, section 7.3). Intervals: loci left out one by one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import LEAD, Batch
from plumbline.estimators import saturation
from plumbline.estimators.clustered import jackknife
from plumbline.models.controller import Law
from plumbline.switching import Regime

Array = NDArray[np.float64]

FAR = 0.5  # [m] a simulated CoM that strays further is held there
ROUNDS = 40
SETTLED = 1e-5  # share of the cost that a full step promises, below which the search has settled
STEPS = np.array([1e-5, 1e-3, 1e-3, 2e-3])  # of d, k1, k2, delay for the derivatives
LONGEST = 0.9 * LEAD  # [s]
GRID = 0.02  # [s] between the delays that a first guess is chosen from


class OutputError(NamedTuple):
    """law with the delay; covariance of (d, k1, k2[, delay]); rms of the simulated against the measured CoM [m]; rms of CoM times rms
    of ZMP [m2], by which fits compare (the determinant criterion, Ljung 1999); loci; converged."""

    law: Law
    covariance: Array
    error: float
    misfit: float
    loci: int
    converged: bool


def fit(batch: Batch, regime: Regime, start: Law, omega: float, *, delayed: bool = False) -> OutputError:
    """Fit reference and gains, and a delay where asked; the limits stay those of `start`.

    batch: loci; regime: (n, m) of its frames; omega: of the plant [rad/s].  start: where the search begins.
    """
    theta = np.array([start.d, start.k1, start.k2, start.delay])
    limits = (start.left, start.right)
    count = 4 if delayed else 3
    scale = _scale(simulate(theta[:, None], batch, regime, omega, limits)[:, :, 0], batch)
    theta, _ = _descend(theta, count, scale, batch, regime, omega, limits)
    scale = _scale(simulate(theta[:, None], batch, regime, omega, limits)[:, :, 0], batch)
    theta, converged = _descend(theta, count, scale, batch, regime, omega, limits)
    return _certified(theta, count, scale, batch, regime, omega, limits, converged)


def _scale(outputs: Array, batch: Batch) -> Array:
    """Rms of dx and dp over the frames of the loci [m], shape (2, 1, 1)."""
    rms = np.sqrt(np.sum(outputs**2, axis=(1, 2)) / batch.inside.sum())
    return np.asarray(np.maximum(rms, 1e-9)[:, None, None])


def _descend(
    theta: Array, count: int, scale: Array, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float]
) -> tuple[Array, bool]:
    """Levenberg-Marquardt from theta (4,), of which the first `count` are free; the minimum and whether the search settled."""
    damp, converged = 1e-3, False
    error, slopes = _derivatives(theta, count, scale, batch, regime, omega, limits)
    for _ in range(ROUNDS):
        normal = np.einsum("iynm,jynm->ij", slopes, slopes)
        downhill = np.einsum("iynm,ynm->i", slopes, error)
        free = np.ones(count, bool)
        free[3:] = theta[3] > 0 or downhill[3:] < 0  # a delay at 0 that wants to be negative stays there
        kept, now = np.ix_(free, free), float(np.sum(error**2))
        if downhill[free] @ np.linalg.lstsq(normal[kept], downhill[free], rcond=None)[0] < SETTLED * now:
            converged = True
            break
        tries = damp * np.array([0.01, 1.0, 100.0])
        points = np.stack([theta] * 3, axis=1)
        for k, much in enumerate(tries):
            points[:count][free, k] -= np.linalg.solve(normal[kept] + much * np.diag(np.diag(normal[kept]) + 1e-12), downhill[free])
        points[3] = np.clip(points[3], 0.0, LONGEST)
        cost = np.sum((simulate(points, batch, regime, omega, limits) / scale[..., None]) ** 2, axis=(0, 1, 3))
        best = int(np.argmin(cost))
        if cost[best] >= now * (1 - 1e-9):
            damp *= 1e3
            if damp > 1e9:  # no step is better: this is the minimum
                converged = True
                break
            continue
        theta, damp = points[:, best], max(tries[best], 1e-9)
        error, slopes = _derivatives(theta, count, scale, batch, regime, omega, limits)
    return theta, converged


def search(batch: Batch, regime: Regime, start: Law, omega: float) -> OutputError:
    """Fit with a delay, from two first guesses: the cost has more than one valley.

    The guesses are no delay and the one with the least equation error. The latter sees a delay nearly everywhere (feedback noise is
    older than the state it moves), so it only starts the search.
    """
    inside = batch.inside & (regime == 0)
    late = [(float(g), *_equation_error(batch.late(float(g)), inside)) for g in np.arange(0.0, LONGEST, GRID)]
    delay, cost, d, k1, k2 = min(late, key=lambda one: one[1])
    guesses = [start, start._replace(d=d, k1=k1, k2=k2, delay=delay)] if np.isfinite(cost) else [start]
    return min((fit(batch, regime, one, omega, delayed=True) for one in guesses), key=lambda one: one.misfit)


def _equation_error(batch: Batch, inside: NDArray[np.bool_]) -> tuple[float, float, float, float]:
    """Sum of squares of p - law over the frames inside the limits, and the law's d, k1, k2; infinite where it cannot be told."""
    x, v, p = batch.x[inside], batch.v[inside], batch.p[inside]
    solved = saturation.linear(x, v, p)
    if solved is None or abs(solved[1] - 1) < 1e-6:
        return np.inf, 0.0, 0.0, 0.0
    c, k1, k2 = solved
    return float(np.sum((p - c - k1 * x - k2 * v) ** 2)), c / (1 - k1), k1, k2


def _derivatives(
    theta: Array, count: int, scale: Array, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float]
) -> tuple[Array, Array]:
    """Scaled outputs (2, n, m) and their derivatives (count, 2, n, m)."""
    points = np.column_stack([theta] + [theta + STEPS * (np.arange(4) == j) for j in range(count)])
    outputs = simulate(points, batch, regime, omega, limits) / scale[..., None]
    return outputs[:, :, 0], np.stack([(outputs[:, :, 1 + j] - outputs[:, :, 0]) / STEPS[j] for j in range(count)])


def _certified(
    theta: Array, count: int, scale: Array, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float], converged: bool
) -> OutputError:
    error, slopes = _derivatives(theta, count, scale, batch, regime, omega, limits)
    normals = np.einsum("iynm,jynm->mij", slopes, slopes)
    scores = np.einsum("iynm,ynm->mi", slopes, error)
    law = Law(float(theta[0]), float(theta[1]), float(theta[2]), *limits, delay=float(theta[3]))
    rms = _scale(error * scale, batch)  # at the minimum, not where its scale was taken
    covariance = jackknife(normals, scores)
    if count > 3 and theta[3] == 0:  # at its bound: the gains are those without a delay, the delay's own interval is one-sided
        covariance[:3, :3] = jackknife(normals[:, :3, :3], scores[:, :3])
        covariance[3, :3] = covariance[:3, 3] = 0.0
    return OutputError(law, covariance, float(rms[0, 0, 0]), float(np.prod(rms)), error.shape[2], converged)


def simulate(points: Array, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float]) -> Array:
    """Simulated minus measured CoM and ZMP for several laws at once.

    points: (4, k) with d [m], k1 [1], k2 [s], delay [s].  limits: left and right [m].
    Returns dx and dp [m], shape (2, n, k, m), 0 outside loci.
    The plant is integrated exactly for a ZMP that is linear between frames.
    """
    k1, k2 = points[1, :, None], points[2, :, None]
    (n, m), k = batch.x.shape, points.shape[1]
    asked = _asked(points, batch)
    dx, dv, reply, out = (np.zeros((n, k, m)) for _ in range(4))  # reply: k1 dx + k2 dv
    back = points[3] * batch.rate
    whole = np.floor(back + 1e-9).astype(int)
    part, which, late, fresh = (back - whole)[:, None], np.arange(k), bool(np.any(back > 1e-9)), (whole == 0)[:, None]
    (left, right), at_left, at_right = limits, regime < 0, regime > 0

    def dp(row: int, now: Array) -> Array:
        """Law minus measured ZMP at a row whose own reply is `now`."""
        if late:
            then = np.where(fresh, now, reply[np.maximum(row - whole, 0), which])
            now = then + part * (reply[np.maximum(row - whole - 1, 0), which] - then)
        wanted = asked[row] + now
        both = ((wanted >= right) & at_right[row]) | ((wanted <= left) & at_left[row])
        clipped = np.minimum(np.maximum(wanted, left), right) - batch.p[row]
        clipped[both] = 0.0
        return np.asarray(clipped)

    t = omega / batch.rate
    c, s = np.cosh(t), np.sinh(t)
    for row in range(batch.lead, n - 1):
        alive = row + 1 < batch.end
        if not alive.any():
            break
        x, v = dx[row], dv[row]
        a = dp(row, reply[row])
        out[row] = a * alive
        x, v = c * x + s / omega * v - (c - 1) * a, omega * s * x + c * v - omega * s * a
        rise = dp(row + 1, k1 * x + k2 * v) - a
        dx[row + 1] = np.minimum(np.maximum(x - (s / t - 1) * rise, -FAR), FAR) * alive
        dv[row + 1] = (v - omega * (c - 1) / t * rise) * alive
        reply[row + 1] = k1 * dx[row + 1] + k2 * dv[row + 1]
    return np.stack([dx, out])


def _asked(points: Array, batch: Batch) -> Array:
    """What each law asks for on the measured motion, before the limits [m], (n, k, m)."""
    d, k1, k2, delay = points
    row = np.maximum(np.arange(len(batch.x))[:, None] - delay * batch.rate, 0.0)
    now = np.floor(row + 1e-9).astype(int)
    part = (row - now)[:, :, None]
    after = np.minimum(now + 1, len(batch.x) - 1)
    x, v = (one[now] + part * (one[after] - one[now]) for one in (batch.x, batch.v))
    return np.asarray(((1 - k1) * d)[:, None] + k1[:, None] * x + k2[:, None] * v)
