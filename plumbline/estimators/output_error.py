r"""Output error: the gains with which the simulated closed loop follows the measured CoM.

Only the deviation from the measured motion is simulated, so that nothing the plant lacks counts against the controller:

.. math:: \delta\ddot x = \omega^2 (\delta x - \delta p), \qquad
    \delta p = \mathrm{clip}\bigl(\mathrm{law}(x + \delta x,\, \dot x + \delta\dot x)\bigr) - p,

from rest at the start of each locus (no start state is fitted), state taken `delay` earlier. Where law and measured ZMP are both at
the same limit :math:`\delta p = 0`: half a millimetre of a limit would grow as e^(wt). The sum of squares of :math:`\delta x` is
minimised (Levenberg 1944, Marquardt 1963). Feedback noise reaches :math:`\delta x` but not the simulated regressors: unlike least
squares the estimate is consistent (Ljung 1999, section 7.3). Intervals: sandwich clustered by locus.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import LEAD, Batch
from plumbline.estimators import saturation
from plumbline.estimators.clustered import sandwich
from plumbline.models.controller import Law
from plumbline.switching import Regime

Array = NDArray[np.float64]

FAR = 0.5  # [m] a simulated CoM that strays further is held there
ROUNDS = 40
STEPS = np.array([1e-5, 1e-3, 1e-3, 2e-3])  # of d, k1, k2, delay for the derivatives
LONGEST = 0.9 * LEAD  # [s]
GRID = 0.02  # [s] between the delays that a first guess is chosen from


class OutputError(NamedTuple):
    """law with the delay; covariance of (d, k1, k2[, delay]); rms of the simulated against the measured CoM [m]; loci; converged."""

    law: Law
    covariance: Array
    error: float
    loci: int
    converged: bool


def fit(batch: Batch, regime: Regime, start: Law, omega: float, *, delayed: bool = False) -> OutputError:
    """Fit reference and gains, and a delay where asked; the limits stay those of `start`.

    batch: loci; regime: (n, m) of its frames; omega: of the plant [rad/s].  start: where the search begins.
    """
    count = 4 if delayed else 3
    theta = np.array([start.d, start.k1, start.k2, start.delay])
    limits = (start.left, start.right)
    damp, converged = 1e-3, False
    error, slopes = _derivatives(theta, count, batch, regime, omega, limits)
    for _ in range(ROUNDS):
        normal = np.einsum("inm,jnm->ij", slopes, slopes)
        downhill = np.einsum("inm,nm->i", slopes, error)
        tries = damp * np.array([0.01, 1.0, 100.0])
        points = np.stack([theta] * 3, axis=1)
        for k, much in enumerate(tries):
            points[:count, k] -= np.linalg.solve(normal + much * np.diag(np.diag(normal) + 1e-12), downhill)
        points[3] = np.clip(points[3], 0.0, LONGEST)
        cost = np.sum(simulate(points, batch, regime, omega, limits) ** 2, axis=(0, 2))
        best, now = int(np.argmin(cost)), float(np.sum(error**2))
        if cost[best] >= now * (1 - 1e-9):
            damp *= 1e3
            if damp > 1e9:  # no step is better: this is the minimum
                converged = True
                break
            continue
        theta, damp = points[:, best], max(tries[best], 1e-9)
        error, slopes = _derivatives(theta, count, batch, regime, omega, limits)
        if cost[best] >= now * (1 - 1e-5):
            converged = True
            break
    return _certified(theta, limits, error, slopes, batch, converged)


def search(batch: Batch, regime: Regime, start: Law, omega: float) -> OutputError:
    """Fit with a delay, from two first guesses: the cost has more than one valley.

    The guesses are no delay and the one with the least equation error. The latter sees a delay nearly everywhere (feedback noise is
    older than the state it moves), so it only starts the search.
    """
    late = [(g, saturation.fit(batch.late(g))) for g in np.arange(0.0, LONGEST, GRID)]
    fitted = [(got.cost, got.law._replace(delay=float(g))) for g, got in late if got is not None]
    guesses = [start]
    if fitted:
        guesses.append(min(fitted, key=lambda one: one[0])[1]._replace(left=start.left, right=start.right))
    return min((fit(batch, regime, guess, omega, delayed=True) for guess in guesses), key=lambda one: one.error)


def _derivatives(theta: Array, count: int, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float]) -> tuple[Array, Array]:
    """Simulated minus measured CoM (n, m) and its derivatives (count, n, m)."""
    points = np.column_stack([theta] + [theta + STEPS * (np.arange(4) == j) for j in range(count)])
    dx = simulate(points, batch, regime, omega, limits)
    return dx[:, 0], np.stack([(dx[:, 1 + j] - dx[:, 0]) / STEPS[j] for j in range(count)])


def _certified(theta: Array, limits: tuple[float, float], error: Array, slopes: Array, batch: Batch, converged: bool) -> OutputError:
    bread = np.linalg.pinv(np.einsum("inm,jnm->ij", slopes, slopes))
    scores = np.einsum("inm,nm->mi", slopes, error)
    law = Law(float(theta[0]), float(theta[1]), float(theta[2]), *limits, delay=float(theta[3]))
    rms = float(np.sqrt(np.sum(error**2) / batch.inside.sum()))
    return OutputError(law, sandwich(bread, scores), rms, error.shape[1], converged)


def simulate(points: Array, batch: Batch, regime: Regime, omega: float, limits: tuple[float, float]) -> Array:
    """Deviation of the simulated from the measured CoM for several laws at once.

    points: (4, k) with d [m], k1 [1], k2 [s], delay [s].  limits: left and right [m].  Returns [m], shape (n, k, m), 0 outside loci.
    The plant is integrated exactly for a ZMP that is linear between frames.
    """
    d, k1, k2, delay = (row[:, None] for row in points)
    (n, m), k = batch.x.shape, points.shape[1]
    dx, dv = np.zeros((n, k, m)), np.zeros((n, k, m))
    back = delay[:, 0] * batch.rate
    whole = np.floor(back + 1e-9).astype(int)
    part, which, late = (back - whole)[:, None], np.arange(k), bool(np.any(back > 1e-9))
    constant, left, right = (1 - k1) * d, *limits

    def dp(row: int, x: Array, v: Array) -> Array:
        """Law minus measured ZMP at a row whose deviation is x, v."""
        if late:
            now, then = np.maximum(row - whole, 0), np.maximum(row - whole - 1, 0)
            fresh = (whole == 0)[:, None]
            x = (1 - part) * (batch.x[now] + np.where(fresh, x, dx[now, which])) + part * (batch.x[then] + dx[then, which])
            v = (1 - part) * (batch.v[now] + np.where(fresh, v, dv[now, which])) + part * (batch.v[then] + dv[then, which])
        else:
            x, v = batch.x[row] + x, batch.v[row] + v
        wanted = constant + k1 * x + k2 * v
        both = ((wanted >= right) & (regime[row] > 0)) | ((wanted <= left) & (regime[row] < 0))
        return np.where(both, 0.0, np.clip(wanted, left, right) - batch.p[row])

    t = omega / batch.rate
    c, s = np.cosh(t), np.sinh(t)
    for row in range(batch.lead, n - 1):
        alive = row + 1 < batch.end
        if not alive.any():
            break
        x, v = dx[row], dv[row]
        a = dp(row, x, v)
        x, v = c * x + s / omega * v - (c - 1) * a, omega * s * x + c * v - omega * s * a
        rise = dp(row + 1, x, v) - a
        dx[row + 1] = np.where(alive, np.clip(x - (s / t - 1) * rise, -FAR, FAR), 0.0)
        dv[row + 1] = np.where(alive, v - omega * (c - 1) / t * rise, 0.0)
    return dx
