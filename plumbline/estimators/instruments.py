r"""Instrumental variables: least squares of the law against regressors that feedback noise cannot have reached.

.. math:: \sum \zeta \bigl(p - c - k_1 x - k_2 \dot x\bigr) = 0, \qquad \zeta = (1,\, x_s,\, \dot x_s)

:math:`x_s`: CoM of the noise-free closed loop, simulated from each locus' start (Soderstrom and Stoica 1983). Frames are chosen by
the simulated law too, well inside the limits: choosing by the measured ZMP would keep the noise that stayed inside.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.batch import Batch
from plumbline.estimators import output_error
from plumbline.estimators.clustered import jackknife
from plumbline.models.controller import Law
from plumbline.switching import Regime

Array = NDArray[np.float64]

MARGIN = 2.5  # sd of the feedback noise that the simulated law stays away from a limit


class Instruments(NamedTuple):
    """law; covariance of (d, k1, k2) by locus (3, 3); loci."""

    law: Law
    covariance: Array
    loci: int


def fit(batch: Batch, regime: Regime, start: Law, omega: float, feedback_sd: float) -> Instruments | None:
    """One step of instrumental variables from a law that is good enough to simulate.

    start: its delay is kept.  feedback_sd: rms of p - law inside [m].  None where fewer than 20 frames are well inside or the
    instruments cannot tell the gains.
    """
    point = np.array([[start.d], [start.k1], [start.k2], [start.delay]])
    dx = output_error.simulate(point, batch, regime, omega, (start.left, start.right))[0, :, 0]
    seen = batch.late(start.delay)
    free = replace(batch, x=batch.x + dx, v=batch.v + np.gradient(dx, 1 / batch.rate, axis=0)).late(start.delay)
    wanted = start.wanted(free.x, free.v)
    margin = MARGIN * feedback_sd
    chosen = batch.inside & (wanted > start.left + margin) & (wanted < start.right - margin)
    if chosen.sum() < 20:
        return None
    one = np.ones(batch.x.shape)
    zeta, phi = (np.stack([one, motion.x, motion.v]) * chosen for motion in (free, seen))
    normals = np.einsum("inm,jnm->mij", zeta, phi)[chosen.any(0)]
    normal = normals.sum(0)
    if np.linalg.cond(normal / np.sqrt(np.outer(np.diag(normal), np.diag(normal)).clip(1e-300))) > 1e8:
        return None
    c, k1, k2 = np.linalg.solve(normal, np.einsum("inm,nm->i", zeta, batch.p))
    error = batch.p - np.tensordot([c, k1, k2], phi, 1)
    scores = np.einsum("inm,nm->mi", zeta, np.where(chosen, error, 0.0))[chosen.any(0)]
    if abs(1 - k1) < 1e-6:
        return None
    d = c / (1 - k1)
    to_d = np.array([[1 / (1 - k1), d / (1 - k1), 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])  # (c, k1, k2) -> (d, k1, k2)
    law = start._replace(d=float(d), k1=float(k1), k2=float(k2))
    return Instruments(law, to_d @ jackknife(normals, scores) @ to_d.T, len(scores))
