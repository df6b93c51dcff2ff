"""Covariance of an estimate whose errors may hang together in any way within a locus."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Array = NDArray[np.float64]


def sandwich(bread: Array, scores: Array) -> Array:
    """Cluster-robust covariance (Liang and Zeger 1986) with the factor g/(g - 1), shape (k, k); NaN for one locus.

    bread: inverse of the derivative of the estimating equations, (k, k).  scores: their sum over each locus, (g, k).
    """
    g = len(scores)
    return np.asarray(bread @ (scores.T @ scores) @ bread.T * (g / (g - 1) if g > 1 else np.nan))


def reach(variance: float, loci: int, level: float = 0.95) -> float:
    """Half width of the t interval with loci - 1 degrees of freedom."""
    return float(stdtrit(max(loci - 1, 1), 0.5 + level / 2) * np.sqrt(variance))
