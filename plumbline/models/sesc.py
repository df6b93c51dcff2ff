r"""A personal CoM from a statically equivalent serial chain: identification from static poses, as a batch and recursively.

The CoM is linear in the chain's parameters, :math:`c = c_0 + B R` (Gonzalez 2013, eq. 6): :math:`B` holds the pose, :math:`R` what
the person's masses and segment CoMs are. At rest the ground projection of the CoM is where all contact forces together have no
horizontal moment (eq. 12), so every still window gives two rows of :math:`y = H R + e`.

What is known of people in general enters as a prior :math:`R \sim N(m, P_0)`. The posterior in information form is

.. math:: P^{-1} = P_0^{-1} + H^T W^{-1} H, \qquad \hat R = m + P H^T W^{-1} (y - H m)

with :math:`W` the covariance of the windows' means: white noise, slow noise that neighbouring windows share, and a floor of what no
rigid chain explains, which poses that are alike share. The paper's recursion (eq. 8-11) is a Kalman filter on the same rows; it
ends at the same numbers when nothing drifts and no constraint binds (``tests/test_sesc_model.py``).

Gonzalez A, Hayashibe M, Demircan E, Fraisse P (2013) Center of mass estimation for rehabilitation in a multi-contact environment.
IEEE SMC.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from plumbline.errors import PlumblineError

Array = NDArray[np.float64]


class Prior(NamedTuple):
    """What is known of the parameters before: mean (q,), covariance (q, q), positive definite."""

    mean: Array
    covariance: Array


class Rows(NamedTuple):
    """Measurements, decorrelated and in units of their noise: matrix (r, q), values (r,), in the order of time.

    unit: log of the determinant of what they were divided by.
    """

    matrix: Array
    values: Array
    unit: float = 0.0


@dataclass(frozen=True)
class Noise:
    """Noise of a ground projection; the numbers are those of a good force plate under somebody who stands.

    white: sd of one sample [m].  slow: sd of a part that is forgotten over `memory` [s].  floor: sd [m] of what the chain cannot
    follow, alike in poses whose segments are turned by less than `reach` [rad].  constant: sd of the error of the CoP that a
    recording has throughout [m].
    """

    white: float = 0.003
    slow: float = 0.002
    memory: float = 2.0
    floor: float = 0.0005
    reach: float = 0.3
    constant: float = 0.001


USUAL = Noise()


@dataclass(frozen=True)
class Posterior:
    """Parameters after the data.

    mean (q,), covariance (q, q).  prior: before.  gains: (q,), falling, how many times stronger than the prior the data speak along
    each of `directions` (q, q), columns, in units of the parameters.  misfit: mean square of the residual in units of its noise [1].
    rows: number of measurements.  evidence: log likelihood of the measurements, the parameters averaged over the prior, but for a
    constant.
    """

    mean: Array
    covariance: Array
    prior: Prior
    gains: Array
    directions: Array
    misfit: float
    rows: int
    evidence: float

    @property
    def relative_error(self) -> Array:
        """sd over size of each parameter [1], shape (q,) (eq. 13)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)) / np.abs(self.mean))


def mean_covariance(at: Array, length: float, samples: int, noise: Noise) -> Array:
    r"""Covariance of the means of windows, one axis [m2], shape (k, k).

    at: middles of the windows [s], shape (k,), at least `length` [s] apart; `samples` in each.

    Of slow noise with variance :math:`\sigma^2` and memory :math:`\tau`, over windows of length T at distance d:
    :math:`\sigma^2 \frac{2\tau}{T} (1 - \frac{\tau}{T}(1 - e^{-T/\tau}))` in one window,
    :math:`\sigma^2 (\tau/T)^2 e^{-d/\tau} (e^{T/\tau} + e^{-T/\tau} - 2)` between two.
    """
    ratio = length / noise.memory
    d = np.abs(at[:, None] - at[None, :])
    shared = (2.0 * np.cosh(ratio) - 2.0) / ratio**2 * np.exp(-d / noise.memory)
    own = 2.0 / ratio * (1.0 - (1.0 - np.exp(-ratio)) / ratio)
    out = noise.slow**2 * np.where(np.eye(len(at), dtype=bool), own, shared)
    return np.asarray(out + np.diag(np.full(len(at), noise.white**2 / samples)))


def floor_covariance(turned: Array, noise: Noise) -> Array:
    """Covariance of what no chain follows, which alike poses share [m2], (k, k).

    turned: rms angle between the segments of two poses [rad], (k, k).
    """
    return np.asarray(noise.floor**2 * np.exp(-0.5 * (turned / noise.reach) ** 2))


def decorrelated(matrix: Array, values: Array, covariance: Array) -> Rows:
    """Rows with unit, independent noise, in the order given.

    matrix: (r, q).  values: (r,).  covariance: of the values' noise (r, r).  Raises PlumblineError where it is not positive definite.
    """
    try:
        lower = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError as error:
        raise PlumblineError("the noise of the ground projections is not positive definite: a window given twice?") from error
    both = solve_triangular(lower, np.column_stack([matrix, values]), lower=True)
    return Rows(both[:, :-1], both[:, -1], float(np.sum(np.log(np.diag(lower)))))


def batch(prior: Prior, rows: Rows) -> Posterior:
    """Maximum a posteriori in information form (see module).  Raises PlumblineError where the prior is not positive definite."""
    scale = _root(prior.covariance)
    design = rows.matrix @ scale
    left = rows.values - rows.matrix @ prior.mean
    information, back = np.linalg.eigh(design.T @ design)
    order = np.argsort(information)[::-1]
    information, back = np.maximum(information[order], 0.0), back[:, order]
    z = back @ ((back.T @ (design.T @ left)) / (1.0 + information))
    directions = scale @ back
    covariance = (directions / (1.0 + information)) @ directions.T
    misfit = float(np.mean((left - design @ z) ** 2)) if len(left) else float("nan")
    loss = float(np.sum((left - design @ z) ** 2) + z @ z + np.sum(np.log1p(information)))
    return Posterior(
        prior.mean + scale @ z, covariance, prior, np.sqrt(information), directions, misfit, len(left), -0.5 * loss - rows.unit
    )


def _root(covariance: Array) -> Array:
    try:
        return np.asarray(np.linalg.cholesky(covariance))
    except np.linalg.LinAlgError as error:
        raise PlumblineError("the prior of the chain is not positive definite: a parameter with no spread, or one given twice") from error


@dataclass(frozen=True)
class Bounds:
    """Constraint of the recursion: lower <= matrix R <= upper, matrix (b, q); what binds is met exactly, the rest is left alone."""

    matrix: Array
    lower: Array
    upper: Array


@dataclass
class Kalman:
    """The paper's recursion (eq. 8-11): the parameters as a state that stays, or drifts with covariance `drift` per update.

    After each update the state is projected on the bounds it breaks, in the metric of its covariance, so that as little as possible
    of what the data said is lost; the covariance is kept, as the bound is a wall and no measurement.
    """

    mean: Array
    covariance: Array
    drift: Array | None = None
    bounds: Bounds | None = None
    bound: list[int] = field(default_factory=list)

    def update(self, h: Array, y: float) -> None:
        """One measurement with unit noise.  h: (q,)."""
        if self.drift is not None:
            self.covariance = self.covariance + self.drift
        ph = self.covariance @ h
        gain = ph / (h @ ph + 1.0)
        left = np.eye(len(h)) - np.outer(gain, h)  # Joseph's form stays symmetric and positive
        self.covariance = left @ self.covariance @ left.T + np.outer(gain, gain)
        self.mean = self.mean + gain * (y - h @ self.mean)
        if self.bounds is not None:
            self._project(self.bounds)

    def _project(self, b: Bounds) -> None:
        """Nearest state inside the bounds: those broken are added one by one and let go again where they pull the wrong way."""
        held = dict[int, float]()
        start = self.mean
        for _ in range(4 * len(b.matrix)):
            value = b.matrix @ self.mean
            over = np.maximum(value - b.upper, b.lower - value)
            over[list(held)] = 0.0
            worst = int(np.argmax(over))
            if over[worst] <= 1e-12:
                break
            held[worst] = float(b.upper[worst] if value[worst] > b.upper[worst] else b.lower[worst])
            self.mean, push = self._meet(b, held, start)
            for i, p in zip(list(held), push, strict=True):
                if p * (1.0 if held[i] == b.upper[i] else -1.0) < 0:
                    del held[i]
        self.bound = sorted(held)

    def _meet(self, b: Bounds, held: dict[int, float], start: Array) -> tuple[Array, Array]:
        d = b.matrix[list(held)]
        pd = self.covariance @ d.T
        push = cho_solve(cho_factor(d @ pd), d @ start - np.array(list(held.values())))
        return start - pd @ push, push


def recursive(prior: Prior, rows: Rows, drift: Array | None = None, bounds: Bounds | None = None) -> Kalman:
    """The paper's recursion over all rows (see :class:`Kalman`).  drift: (q, q) per row; None: the parameters stay."""
    state = Kalman(prior.mean.copy(), prior.covariance.copy(), drift, bounds)
    for h, y in zip(rows.matrix, rows.values, strict=True):
        state.update(h, float(y))
    return state


def spread(basis: Array, covariance: Array) -> Array:
    """Predicted sd of the CoM [m], (n, 3).  basis: (n, 3, q).  covariance: of the parameters (q, q)."""
    return np.asarray(np.sqrt(np.einsum("nij,jk,nik->ni", basis, covariance, basis)))


def chain(rotations: Array) -> Array:
    """Basis of eq. 6, B = [A_1 ... A_s], shape (n, 3, 3 s); the CoM counts from the root's origin.

    rotations: of the segments, segment -> world, shape (n, s, 3, 3).
    """
    n, s = rotations.shape[:2]
    return np.asarray(np.moveaxis(rotations, 1, 2).reshape(n, 3, 3 * s))


def tied(basis: Array, ties: Array) -> Array:
    """Basis of fewer parameters, R = ties R', shape (n, 3, r): left with right, or a CoM on its segment's axis.  ties: (q, r)."""
    return np.asarray(basis @ ties)
