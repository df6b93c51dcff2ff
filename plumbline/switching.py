r"""Switching points: where the ZMP comes to a limit and where it leaves it, without hands.

1. *Regimes.* Every frame is at the left limit, inside, or at the right limit. The sequence that minimises

   .. math:: \sum_k \frac{(p_k - \hat p_{r_k})^2}{s_{r_k}^2} + 2\ln s_{r_k} \;+\; 2 \ln(T f)\,\#\{k: r_k \ne r_{k-1}\}

   is found exactly over any number of switches by dynamic programming on the cumulative costs (Viterbi 1967); :math:`\hat p` is a
   limit or the law, s the pooled noise of each, T f the mean frames between switches.
2. *Instants.* Feedback noise shifts the law by millimetres, slowly. At a switch, though, the ZMP is AT the limit, so
   near it p = limit + (law - law at the switch) holds whatever the shift: the change point is scanned frame by frame.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import Batch
from plumbline.models.controller import Law

Array = NDArray[np.float64]
Regime = NDArray[np.int8]

MEAN_STAY = 1.0  # [s] between two switches, before any is seen
SCAN = 0.1  # [s] a switch is looked for so far from where the regimes put it
FIT = 0.1  # [s] of the law beyond the scan that the change point is judged on


class Noise(NamedTuple):
    """Pooled noise: sd of p at a limit, sd of p - law inside [m]; correlation time of the latter [s]."""

    limit: float
    inside: float
    time: float


def noise(batch: Batch, law: Law, at_limit: float, inside: float) -> Noise:
    """Pooled noise of a fitted law; the correlation time from the lag at which the autocorrelation of p - law falls to 1/e.

    at_limit, inside: rms of the fit [m]; where no limit was reached a third of `inside` stands for the first.
    """
    here = batch.inside & (law.region(batch.x, batch.v) == 0)
    error = np.where(here, batch.p - law.wanted(batch.x, batch.v), 0.0)
    first, step = 0.0, max(1, round(0.02 * batch.rate))
    time = step / batch.rate
    for lag in range(step, round(1.0 * batch.rate), step):
        pairs = here[lag:] & here[:-lag]
        product = float(np.sum(error[lag:] * error[:-lag]) / max(pairs.sum(), 1))
        first = first or product
        if first <= 0 or product < first / np.e:
            break
        time = lag / batch.rate
    return Noise(at_limit if np.isfinite(at_limit) and at_limit > 0 else inside / 3, inside, time)


def regimes(batch: Batch, law: Law, noise: Noise) -> Regime:
    """Regime of each frame, (n, m): -1 at the left limit, 0 inside, +1 at the right one; outside a locus that of its nearest frame."""
    n, m = batch.p.shape
    wanted = law.wanted(batch.x, batch.v)
    errors = (batch.p - law.left, batch.p - wanted, batch.p - law.right)
    cost = np.stack([_misfit(e, sd) for e, sd in zip(errors, (noise.limit, noise.inside, noise.limit), strict=True)])
    cost = np.where(batch.inside, cost, 0.0)
    stay = 2 * float(np.log(max(MEAN_STAY * batch.rate, 2.0)))
    best, came = cost[:, 0], np.zeros((n, 3, m), np.int8)
    for k in range(1, n):
        cheapest = np.argmin(best, axis=0)
        change = np.take_along_axis(best, cheapest[None], 0)[0] + stay
        came[k] = np.where(best <= change, np.arange(3)[:, None], cheapest)
        best = np.minimum(best, change) + cost[:, k]
    out = np.empty((n, m), np.int8)
    out[-1] = np.argmin(best, axis=0)
    for k in range(n - 1, 0, -1):
        out[k - 1] = np.take_along_axis(came[k], out[k][None].astype(np.intp), 0)[0]
    return np.asarray(out - 1, dtype=np.int8)


def _misfit(error: Array, sd: float) -> Array:
    """Minus twice the log likelihood but for a constant; infinite where the limit is."""
    known = np.isfinite(error)
    return np.where(known, (np.where(known, error, 0.0) / sd) ** 2 + 2 * float(np.log(sd)), np.inf)


def refine(regime: Regime, batch: Batch, law: Law, noise: Noise) -> Regime:
    """The regimes with each switch moved to its change point."""
    out = regime.copy()
    wanted = law.wanted(batch.x, batch.v)
    for j in range(regime.shape[1]):
        rows = slice(batch.lead, int(batch.end[j]))
        out[rows, j] = _refined(regime[rows, j], batch.p[rows, j], wanted[rows, j], law, noise, batch.rate)
    return out


def _refined(regime: Regime, p: Array, wanted: Array, law: Law, noise: Noise, rate: float) -> Regime:
    at = np.flatnonzero(np.diff(regime)) + 1
    out = regime.copy()
    bounds = np.concatenate([[0], at, [len(p)]])
    for i, k in enumerate(at):
        before, after = int(regime[k - 1]), int(regime[k])
        if before and after:  # straight from one limit to the other: nothing of the law between
            continue
        # a switch may move up to half of its neighbours' stay
        low = max((bounds[i] + k) // 2, k - round(SCAN * rate), 1)
        high = min((k + bounds[i + 2]) // 2, k + round(SCAN * rate), len(p) - 1)
        beyond = round(FIT * rate)
        a, b = max(bounds[i], low - beyond), min(bounds[i + 2], high + beyond)
        limit = law.left if -1 in (before, after) else law.right
        j = _change_point(p[a:b] - limit, wanted[a:b], np.arange(low - a, high - a + 1), noise, rate, leaves=after == 0) + a
        out[min(j, k) : max(j, k)] = after if j < k else before
    return out


def _change_point(q: Array, wanted: Array, candidates: NDArray[np.int64], noise: Noise, rate: float, *, leaves: bool) -> int:
    """First frame after the switch, of all `candidates` the likeliest.

    q: p - limit [m], (n,).  wanted: law [m], (n,).  leaves: True where the ZMP leaves the limit here, False where it comes to it.
    On the law's side the error grows from the switch as Ornstein-Uhlenbeck noise does from a known value.
    """
    frame = np.arange(len(q))[None]
    first = candidates[:, None]
    held = frame < first if leaves else frame >= first
    border = (wanted[candidates] + wanted[np.maximum(candidates - 1, 0)])[:, None] / 2  # the law where it crosses the limit
    away = np.abs(frame - first + 0.5) / rate
    grown = noise.limit**2 + noise.inside**2 * (1 - np.exp(-2 * away / noise.time))
    error = np.where(held, q[None], q[None] - (wanted[None] - border))
    variance = np.where(held, noise.limit**2, grown)
    cost = np.sum(error**2 / variance + np.log(variance), axis=1)
    return int(candidates[np.argmin(cost)])


def limits(regime: Regime, batch: Batch, law: Law) -> Law:
    """The law with each limit the mean ZMP over the frames at it; infinite where none is."""
    here = batch.inside

    def mean(side: int) -> float:
        at = here & (regime == side)
        return float(batch.p[at].mean()) if at.any() else side * np.inf

    return law._replace(left=mean(-1), right=mean(+1))
