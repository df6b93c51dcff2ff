"""Estimators side by side: the segment table, the prior and all windows at once, the paper's recursion, and three that make it worse.

Each takes recordings of one person that calibrate and gives the CoM in any other, with a predicted sd where it has one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gonzalez2013.chain import Scene
from plumbline.calibration import Calibration, calibrate
from plumbline.models import sesc
from plumbline.models.sesc import USUAL, Bounds, Noise, Prior, Rows

Array = NDArray[np.float64]
Told = Callable[[Scene], tuple[Array, Array]]  # recording -> CoM and its sd, each (n, 3) [m]; NaN where none is predicted

ANY = 1.0  # [m] sd of a parameter of which nothing is known: a body's length
WEAK = 0.02  # [m] sd of a weak prior: three times what people differ by
REACH = 0.8  # [m] no parameter of the seven is longer than a trunk with head


@dataclass(frozen=True)
class Estimator:
    """title: in words.  fit: recordings that calibrate -> CoM in any other."""

    title: str
    fit: Callable[[Sequence[Scene]], Told]


# -- ours -------------------------------------------------------------------------------------------------------------


def table(_: Sequence[Scene]) -> Told:
    """The segment table, uncalibrated."""
    return lambda s: (s.columns.table, np.full_like(s.columns.table, np.nan))


def calibrated(scenes: Sequence[Scene], times: float = 1.0, shift: Array | None = None, noise: Noise = USUAL) -> Calibration:
    """The library's calibration.  times: spread of the prior over the published one.  shift: of its mean in sd (q,)."""
    prior = scenes[0].columns.prior(times)
    if shift is not None:
        prior = Prior(prior.mean + shift * np.sqrt(np.diag(prior.covariance)), prior.covariance)
    return calibrate([(str(i), w) for i, s in enumerate(scenes) for w in s.still], {}, prior, noise)


def of_calibration(c: Calibration) -> Told:
    """CoM and predicted sd by a calibration, with what no chain follows."""

    def told(s: Scene) -> tuple[Array, Array]:
        b = s.columns.basis
        return s.columns.table + b @ c.mean, np.hypot(sesc.spread(b, c.covariance), c.noise.floor)

    return told


def batch(scenes: Sequence[Scene]) -> Told:
    """All windows and what is known of people at once (see plumbline/calibration.py)."""
    return of_calibration(calibrated(scenes))


# -- the paper's ------------------------------------------------------------------------------------------------------


def rows(scenes: Sequence[Scene], noise: Noise = USUAL) -> Rows:
    """Rows of the seven parameters from still windows, x and y in turn, their noise taken as white, as the paper does."""
    sd = np.hypot(noise.white / np.sqrt(scenes[0].still[0].samples), noise.slow)
    h = [s.at(w, s.basis)[:2] for s in scenes for w in s.still]
    y = [w.ground - s.at(w, s.root)[:2] for s in scenes for w in s.still]
    return Rows(np.concatenate(h) / sd, np.concatenate(y) / sd)


def kalman(scenes: Sequence[Scene], mean: Array, sd: float, bounds: Bounds | None = None) -> Told:
    """The paper's recursion (eq. 8-11) without drift.  mean (7,), sd [m]: what it starts from."""
    h = rows(scenes)
    state = sesc.recursive(Prior(mean, sd**2 * np.eye(7)), h, None, bounds)
    return lambda s: (s.root + s.basis @ state.mean, sesc.spread(s.basis, state.covariance))


def kalman_zero(scenes: Sequence[Scene]) -> Told:
    """From parameters of zero, nothing known."""
    return kalman(scenes, np.zeros(7), ANY)


def kalman_bounded(scenes: Sequence[Scene]) -> Told:
    """The same, each parameter held to its sign and to a body's reach; the sideways one to a hand's breadth."""
    low, high = np.array([-0.1, -0.05, *[0.0] * 5]), np.array([0.1, 0.05, *[REACH] * 5])
    return kalman(scenes, np.zeros(7), ANY, Bounds(np.eye(7), low, high))


def kalman_weak(scenes: Sequence[Scene]) -> Told:
    """From the table's parameters, hardly believed."""
    return kalman(scenes, scenes[0].table_parameters(), WEAK)


# -- what makes it worse ----------------------------------------------------------------------------------------------


def seven(scenes: Sequence[Scene]) -> Told:
    """Least squares of the seven parameters, nothing known before: what total least squares is compared with."""
    h = rows(scenes)
    return _of_seven(np.asarray(np.linalg.lstsq(h.matrix, h.values, rcond=None)[0], dtype=np.float64))


def total_least_squares(scenes: Sequence[Scene]) -> Told:
    """The same with errors of the pose counted as those of the plates: the smallest singular vector of [H y]."""
    h = rows(scenes)
    v = np.linalg.svd(np.column_stack([h.matrix, h.values]), full_matrices=False)[2][-1]
    return _of_seven(-v[:-1] / v[-1])


def _of_seven(r: Array) -> Told:
    return lambda s: (s.root + s.basis @ r, np.full((len(s.time), 3), np.nan))


def wandering(scenes: Sequence[Scene]) -> Told:
    """The same rows and prior, the parameters free to wander by the prior's sd over the recording: the last ones count."""
    c = calibrated(scenes)
    p = c.posterior.prior
    state = sesc.recursive(p, c.rows, p.covariance / len(c.rows.values))
    return _shifted(c, state.mean)


def with_acceleration(scenes: Sequence[Scene], moving: Scene, pull: Array, sd: float) -> Told:
    """The same with m a = F of a moving recording, its noise taken as the force's: that of the orientations is forgotten.

    pull: F/m without weight [m/s2], (n, 3).  sd: of that [m/s2].  Second differences over 0.1 s.
    """
    c = calibrated(scenes)
    k = max(round(0.05 / (moving.time[1] - moving.time[0])), 1)
    step = k * (moving.time[1] - moving.time[0])

    def bent(v: Array) -> Array:
        return np.asarray((v[2 * k :: k] - 2 * v[k:-k:k] + v[: -2 * k : k]) / step**2)

    h = bent(moving.columns.basis).reshape(-1, moving.columns.basis.shape[2]) / sd
    y = (pull[k:-k:k] - bent(moving.columns.table)).ravel() / sd
    h = np.column_stack([h, np.zeros((len(h), 2))])
    both = Rows(np.vstack([c.rows.matrix, h]), np.append(c.rows.values, y))
    return _shifted(c, sesc.batch(c.posterior.prior, both).mean)


def _shifted(c: Calibration, mean: Array) -> Told:
    """CoM by other parameters (q + 2,); no sd, as none holds."""
    other = of_calibration(replace(c, posterior=replace(c.posterior, mean=mean)))
    return lambda s: (other(s)[0], np.full((len(s.time), 3), np.nan))


PAPER = {
    "table": Estimator("segment table", table),
    "kalman_zero": Estimator("the paper's recursion, from zero", kalman_zero),
    "kalman_bounded": Estimator("the same, bounded", kalman_bounded),
    "kalman_weak": Estimator("the same, from a weak prior", kalman_weak),
    "batch": Estimator("all windows with the prior", batch),
}
