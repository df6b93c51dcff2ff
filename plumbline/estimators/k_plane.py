r"""k-plane clustering of the piecewise-affine law (Ferrari-Trecate, Muselli, Liberati, Morari 2003, Automatica 39:205-217).

1. Each frame gets the affine fit :math:`\theta_j` to its `NEAR` nearest frames in the (x, x') plane (local data set), its covariance
   :math:`V_j` and the mean :math:`m_j` and scatter :math:`Q_j` of those frames.
2. Feature vectors :math:`\xi_j = (\theta_j, m_j)` with :math:`R_j = \mathrm{diag}(V_j, Q_j)` fall into s = 3 clusters that minimise
   :math:`\sum_j |\xi_j - \mu_{i(j)}|^2` in the metric :math:`R_j^{-1}` (k-means; the best of `STARTS` random starts).
3. Each piece is fitted by least squares over its frames with the confidence :math:`w_j \propto \det R_j^{-1/2}`: frames whose
   neighbours lie in two pieces hardly count.
4. Regions follow from linear separation of the clusters.
"""

from typing import NamedTuple

import numpy as np

from plumbline.estimators.pieces import Array, Frames, Labels, Pieces, answer, local_fits, named, regions, thinned

PIECES = 3
NEAR = 40  # frames of a local data set
STARTS = 10
ROUNDS = 50
FLOOR = 1e-6  # [m] least standard error: noise-free frames would have infinite confidence


class Features(NamedTuple):
    """xi (n, 5), inverse of R (n, 5, 5), confidence w (n,), the largest 1."""

    xi: Array
    metric: Array
    confidence: Array


def estimate(x: Array, v: Array, p: Array, length: Labels, rate: float, *, seed: int = 0) -> Pieces:
    """The law's pieces by k-plane clustering; `own` is the clusters' mean squared feature distance [1].

    x [m], v [m/s], p [m]: CoM, its velocity, measured ZMP, (n, m), padded after length (m,).  rate [Hz] is not used: frames are
    thinned over the plane (`pieces.thinned`).  seed: of the random starts.  Raises ValueError with fewer than 50 frames.
    """
    frames = thinned(x, v, p, length)
    about = features(frames)
    labels, rounds, cost = clustered(about, np.random.default_rng(seed))
    law = named(frames, labels, about.confidence)
    regime = regions(frames, law.side, x, v, length)
    return answer(law, regime, rounds, cost)


def features(frames: Frames) -> Features:
    """Feature vectors with their metric and confidence."""
    near = min(NEAR, len(frames.p))
    fits = local_fits(frames, near)
    z = frames.unit[fits.near][:, :, 1:]
    mean = z.mean(1)
    scatter = np.einsum("nci,ncj->nij", z - mean[:, None], z - mean[:, None])
    r = np.zeros((len(frames.p), 5, 5))
    r[:, :3, :3] = np.maximum(fits.variance, FLOOR**2)[:, None, None] * fits.inverse
    r[:, 3:, 3:] = scatter + 1e-10 * np.eye(2)
    metric: Array = np.asarray(np.linalg.inv(r), np.float64)
    size = np.asarray(np.linalg.slogdet(r)[1], np.float64)
    return Features(np.hstack([fits.theta, mean]), metric, np.asarray(np.exp((size.min() - size) / 2)))


def clustered(about: Features, rng: np.random.Generator) -> tuple[Labels, int, float]:
    """Labels (n,), rounds and mean squared distance of the best k-means run."""
    best: tuple[Labels, int, float] | None = None
    for _ in range(STARTS):
        run = _k_means(about, about.xi[rng.choice(len(about.xi), PIECES, replace=False)])
        if best is None or run[2] < best[2]:
            best = run
    assert best is not None
    return best


def _k_means(about: Features, centres: Array) -> tuple[Labels, int, float]:
    labels = np.full(len(about.xi), -1)
    pull = np.einsum("nij,nj->ni", about.metric, about.xi)
    rounds = 0
    while rounds < ROUNDS:
        rounds += 1
        gap = about.xi[:, None] - centres
        distance = np.einsum("nki,nij,nkj->nk", gap, about.metric, gap, optimize=True)
        new = distance.argmin(1)
        if np.array_equal(new, labels):
            break
        labels = new
        for k in np.unique(labels):
            here = labels == k
            centres[k] = np.linalg.solve(about.metric[here].sum(0), pull[here].sum(0))
    return labels, rounds, float(distance.min(1).mean())
