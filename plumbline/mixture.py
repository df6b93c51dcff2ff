r"""How many values are there? Clusters of estimates that each have their own standard error.

Model: estimate i is normal around the value of its cluster, with variance :math:`s_i^2 + \tau^2`; s its own standard error, tau what
loci of one cluster differ by beyond it. The number of clusters is the one that predicts loci left out; it grows only where a
further cluster predicts them better by more than two standard errors of the difference.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST = 4  # clusters tried
FEWEST = 4  # loci a cluster must hold
FOLDS = 8
SURE = 2.0  # standard errors by which a further cluster must predict better
ROUNDS = 200


class Mixture(NamedTuple):
    """Centres in ascending order (k,), shares (k,), variance tau^2 between loci of one cluster."""

    centre: Array
    share: Array
    between: float

    def log_density(self, value: Array, se: Array) -> Array:
        """Log density of each estimate under each cluster, share included, (n, k)."""
        variance = se[:, None] ** 2 + self.between
        return np.asarray(np.log(self.share) - 0.5 * np.log(2 * np.pi * variance) - (value[:, None] - self.centre) ** 2 / (2 * variance))

    def posterior(self, value: Array, se: Array) -> Array:
        """Probability of each cluster for each estimate, (n, k)."""
        log = self.log_density(value, se)
        weight = np.exp(log - log.max(1, keepdims=True))
        return np.asarray(weight / weight.sum(1, keepdims=True))


class Choice(NamedTuple):
    """The mixture chosen; numbers tried, their mean held-out log density per locus and the standard error of the gain of each
    number over the one before (NaN for the first)."""

    mixture: Mixture
    number: NDArray[np.int64]
    score: Array
    gain_se: Array


def fit(value: Array, se: Array, number: int) -> Mixture:
    """Maximum likelihood by expectation and maximisation, started at quantiles of the estimates.

    value, se: (n,), n >= number, no NaN, se > 0.  tau^2 is found by Newton steps kept at or above 0.
    """
    centre = np.quantile(value, (np.arange(number) + 0.5) / number)
    within = value[:, None] - centre
    between = max(float(np.mean(np.min(within**2, axis=1)) - np.median(se) ** 2), 0.0)
    mixture = Mixture(centre, np.full(number, 1 / number), between)
    for _ in range(ROUNDS):
        weight = mixture.posterior(value, se)
        variance = se**2 + mixture.between
        precise = weight / variance[:, None]
        centre = (precise * value[:, None]).sum(0) / np.maximum(precise.sum(0), 1e-300)
        square = (weight * (value[:, None] - centre) ** 2).sum(1)
        slope = np.sum((square - variance) / variance**2)  # of twice the log likelihood in tau^2
        between = max(mixture.between + slope / np.sum(1 / variance**2), 0.0)
        moved = np.max(np.abs(centre - mixture.centre))
        mixture = Mixture(centre, np.maximum(weight.mean(0), 1e-6), float(between))
        if moved < 1e-6 * np.ptp(value):
            break
    order = np.argsort(mixture.centre)
    return Mixture(mixture.centre[order], mixture.share[order], mixture.between)


def choose(value: Array, se: Array) -> Choice:
    """Number of clusters by loci left out, in folds that do not depend on any random number.

    value, se: (n,), no NaN, se > 0.  Raises ValueError where there is no estimate at all.
    """
    if not len(value):
        raise ValueError("no estimate to cluster")
    se = np.maximum(se, 1e-9 * np.abs(value).max() + 1e-300)
    held = [_held_out(value, se, k) for k in range(1, MOST + 1) if len(value) >= FEWEST * k or k == 1]
    gains = [later - earlier for earlier, later in pairwise(held)]
    gain_se = [float("nan")] + [float(np.std(g, ddof=1) / np.sqrt(len(g))) if len(g) > 1 else np.inf for g in gains]
    best = 1
    for k in range(2, len(held) + 1):
        gain = held[k - 1] - held[best - 1]
        mixture = fit(value, se, k)
        populated = np.bincount(mixture.posterior(value, se).argmax(1), minlength=k).min() >= FEWEST
        if populated and gain.mean() > SURE * np.std(gain, ddof=1) / np.sqrt(len(gain)):
            best = k
    number = np.arange(1, len(held) + 1)
    return Choice(fit(value, se, best), number, np.array([h.mean() for h in held]), np.array(gain_se))


def _held_out(value: Array, se: Array, number: int) -> Array:
    """Log density of each estimate under the mixture of the other folds, (n,)."""
    out = np.empty(len(value))
    fold = np.argsort(np.argsort(value, kind="stable"), kind="stable") % min(FOLDS, max(len(value), 2))
    for k in np.unique(fold):
        test = fold == k
        rest = value[~test] if (~test).any() else value
        mixture = fit(rest, se[~test] if (~test).any() else se, number)
        log = mixture.log_density(value[test], se[test])
        top = log.max(1)
        out[test] = top + np.log(np.exp(log - top[:, None]).sum(1))
    return out
