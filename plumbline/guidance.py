r"""What a set of poses can and cannot tell of a personal CoM, and which pose to record next.

Poses with feet and hands in the same places leave a direction :math:`v` with :math:`B v` constant: both ends of the body stay where
they are, so a heavier leg against a lighter arm shifts the CoM by the same vector in all of them. The vector is mostly vertical;
its small horizontal part is all that the plates see of it, so a constant error of the CoP of 1 mm becomes one of about 3 mm upwards,
and what is known of the vertical is what was known of people before. It is called observable only if it is known without both.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.models.sesc import spread

Array = NDArray[np.float64]

WIDER = 4.0  # [1] times the spread of people
RESTS = 2.0  # [1] above, what is said of the vertical is the prior's


class Step(NamedTuple):
    """A pose worth recording: its name, and the mean predicted sd of the intended motion after it [m], (3,)."""

    pose: str
    sd: Array


def mean_spread(basis: Array, covariance: Array) -> Array:
    """rms over a motion of the predicted sd [m], per axis (3,).  basis: (n, 3, q)."""
    return np.asarray(np.sqrt(np.mean(spread(basis, covariance) ** 2, axis=0)))


def rests_on_prior(rows: Array, prior: Array, motion: Array) -> float:
    """How many times the predicted vertical error grows if people may differ `WIDER` times as much [1].

    1: the poses decide; `WIDER`: the prior.

    rows: whitened rows (r, q + k), in the last columns constant errors of the CoP, of which nothing is trusted here.
    prior: covariance of the parameters (q, q).  motion: basis of the intended motion (n, 3, q).
    """
    own, constants = rows[:, : len(prior)], rows[:, len(prior) :]
    project, _ = np.linalg.qr(constants[:, constants.any(axis=0)])
    free = own - project @ (project.T @ own)
    return float(mean_spread(motion, after(WIDER**2 * prior, free))[2] / mean_spread(motion, after(prior, free))[2])


def after(covariance: Array, rows: Array) -> Array:
    """Covariance after rows with unit noise.  covariance: (q, q).  rows: (r, q)."""
    if len(rows) > len(covariance):  # as many equations as unknowns say the same
        rows = np.asarray(np.linalg.qr(rows, mode="r"))
    ph = covariance @ rows.T
    return np.asarray(covariance - ph @ np.linalg.solve(rows @ ph + np.eye(len(rows)), ph.T))


def next_poses(covariance: Array, motion: Array, candidates: Mapping[str, Array], sd: float, count: int = 1) -> Sequence[Step]:
    """The poses that lower the predicted variance of the motion most (V-optimal), one after the other.

    covariance: of the parameters now (q, q).  motion: basis of the intended motion (n, 3, q).  candidates: name -> basis of a held
    pose, its horizontal rows (2, q).  sd: of the mean of a held pose [m].
    """
    out = list[Step]()
    gram = np.einsum("nij,nik->jk", motion, motion) / len(motion)
    for _ in range(count):
        best = min(candidates, key=lambda k: float(np.sum(gram * after(covariance, candidates[k] / sd))))
        covariance = after(covariance, candidates[best] / sd)
        out.append(Step(best, mean_spread(motion, covariance)))
    return out


def outside(directions: Array, known: Array, reach: float) -> NDArray[np.bool_]:
    """Frames with a segment that points further than `reach` [rad] from where it pointed in any calibration pose, (n,).

    directions: unit vectors (n, s, 3).  known: of the calibration poses (k, s, 3).
    """
    far = np.zeros(len(directions), dtype=bool)
    for s in range(directions.shape[1]):  # one segment at a time: all at once would not fit into memory
        far |= ~((directions[:, s] @ known[:, s].T).max(axis=1) >= np.cos(reach))  # so that a missing segment counts as far
    return far
