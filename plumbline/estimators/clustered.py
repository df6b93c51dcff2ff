"""Covariance of an estimate whose errors may hang together in any way within a locus."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Array = NDArray[np.float64]


def jackknife(normals: Array, scores: Array) -> Array:
    r"""Covariance of an estimate from what each locus, left out, would move it by, shape (k, k); NaN for one locus.

    .. math:: \frac{g-1}{g} \sum_j \Delta_j \Delta_j^T, \qquad \Delta_j = (N - N_j)^{-1} s_j

    normals: derivative of the estimating equations over each locus, (g, k, k).  scores: their sum over each locus, (g, k).
    To first order this is the cluster-robust sandwich (Liang and Zeger 1986), which is too small where single loci weigh much: such a
    locus bends the estimate towards itself and its score is small (Bell and McCaffrey 2002, CR3).
    """
    g = len(scores)
    if g < 2:
        return np.full((scores.shape[1],) * 2, np.nan)
    moved = np.stack([np.linalg.pinv(normals.sum(0) - one) @ s for one, s in zip(normals, scores, strict=True)])
    return np.asarray((g - 1) / g * moved.T @ moved)


def reach(variance: float, loci: int, level: float = 0.95) -> float:
    """Half width of the t interval with loci - 1 degrees of freedom."""
    return float(stdtrit(max(loci - 1, 1), 0.5 + level / 2) * np.sqrt(variance))
