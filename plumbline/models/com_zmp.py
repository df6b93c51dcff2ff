r"""The plant of Murai 2013: the CoM falls away from the ZMP.

.. math:: \ddot x = \omega^2 (x - x_Z), \qquad \omega^2 = (\ddot z + g)/z  \qquad \text{(1), (2)}
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

Array = NDArray[np.float64]


def com_acceleration(x: Array, p: Array, w2: float) -> Array:
    r"""Acceleration of the CoM, :math:`\ddot x = \omega^2 (x - x_Z)` (Murai 2013, eq. 1).

    x, p: position of CoM and ZMP [m], shape (n,).  w2: squared natural frequency [1/s2].  Returns [m/s2], shape (n,).
    """
    return w2 * (x - p)


def zmp_error(acceleration: Array, lever: Array, w2: float) -> Array:
    """Residual of eq. 1 as a distance of the ZMP: (x - p) - x''/w2 [m].

    acceleration: x'' [m/s2].  lever: x - p [m].  Positive where the measured ZMP lies left of (behind) the modelled one.
    """
    return lever - acceleration / w2


class PlantFit(NamedTuple):
    """Least squares of x'' = w2 (x - p) + c with its certificate.

    w2 [1/s2], c [m/s2], their covariance (2, 2) clustered; dof of the t interval; windows used; clusters; condition number;
    rms of the residual [m/s2].
    """

    w2: float
    constant: float
    covariance: Array
    dof: int
    windows: int
    clusters: int
    condition: float
    rms: float

    @property
    def omega(self) -> float:
        """Natural frequency [rad/s]; NaN where w2 is not positive."""
        return float(np.sqrt(self.w2)) if self.w2 > 0 else float("nan")

    def omega_interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of omega [rad/s] from the t interval of w2; a bound below w2 = 0 is 0."""
        reach = stdtrit(max(self.dof, 1), 0.5 + level / 2) * np.sqrt(self.covariance[0, 0])
        low, high = max(self.w2 - reach, 0.0), max(self.w2 + reach, 0.0)
        return float(np.sqrt(low)), float(np.sqrt(high))


class Noise(NamedTuple):
    """What white sensor noise adds to the regression, per window: variance of x - p [m2], its covariance with x'' [m2/s2]."""

    variance: Array
    covariance: Array


def fit(acceleration: Array, lever: Array, cluster: NDArray[np.int64], noise: Noise | None = None) -> PlantFit | None:
    r"""Fit w2 with a free constant beside it, so that a constant CoP or CoM offset cannot bias it.

    acceleration, lever: weak x'' [m/s2] and x - p [m], shape (n,), no NaN.  cluster: (n,) whole loci (or blocks); errors within a
    cluster may be correlated in any way (Liang and Zeger 1986, with the factor g/(g - 1)).  noise: each of shape (n,), taken off
    the normal equations: x stands on both sides, and plain least squares is biased towards zero by the noise of x - p and
    again by its covariance with x'' (0.1 % for 1 mm on quiet loci).
    None where two parameters cannot be told from the data (fewer than 3 windows, or x - p does not vary above its noise).
    """
    n = len(lever)
    spread = float(np.ptp(lever)) if n else 0.0
    if n < 3 or spread < 1e-9:
        return None
    # the constant is carried as w2 * offset: both columns then have like size
    a = np.column_stack([lever, np.full(n, spread)])
    normal, right = a.T @ a, a.T @ acceleration
    share = np.zeros((n, 2))
    if noise is not None:
        normal[0, 0] -= noise.variance.sum()
        right[0] -= noise.covariance.sum()
    if np.linalg.eigvalsh(normal)[0] <= 1e-12 * normal.max():
        return None
    theta = np.linalg.solve(normal, right)
    e = acceleration - a @ theta
    if noise is not None:
        share[:, 0] = noise.covariance - noise.variance * theta[0]  # expected score of a window at the true w2
    bread = np.linalg.inv(normal)
    labels, inverse = np.unique(cluster, return_inverse=True)
    g = len(labels)
    scores = np.zeros((g, 2))
    np.add.at(scores, inverse, a * e[:, None] - share)
    factor = g / (g - 1) if g > 1 else np.nan
    covariance = factor * bread @ (scores.T @ scores) @ bread
    scale = np.array([1.0, spread])
    return PlantFit(
        w2=float(theta[0]),
        constant=float(theta[1] * spread),
        covariance=covariance * np.outer(scale, scale),
        dof=g - 1,
        windows=n,
        clusters=g,
        condition=float(np.sqrt(np.linalg.cond(a.T @ a))),
        rms=float(np.sqrt(np.mean(e**2))),
    )


def bounded_motion(p: Array, omega: float, rate: float) -> tuple[Array, Array]:
    """The bounded solution of eq. 1 for a measured ZMP: half the sum of a causal and an anticausal first-order response.

    With xi = x + x'/w and eta = x - x'/w, eq. 1 splits into xi' = w (xi - p), run backwards in time, and eta' = -w (eta - p),
    run forwards; x = (xi + eta)/2.  p: [m], shape (n,), linear between samples.  omega [rad/s].  rate [Hz].
    Returns x [m] and x' [m/s], each (n,).
    """
    eta, xi = _lagging(p, omega / rate), _lagging(p[::-1], omega / rate)[::-1]
    return (xi + eta) / 2, omega * (xi - eta) / 2


def _lagging(p: Array, r: float) -> Array:
    """First-order response to p, exact for lines between samples, at rest at the start.  r: omega times the sample time [1]."""
    a = np.exp(-r)
    share = (1 - a) / r
    y = np.concatenate([p[:1], (1 - share) * p[1:] + (share - a) * p[:-1]])
    step = 1
    while step < len(y):  # y_k = a y_(k-1) + u_k for all k at once: reach doubles with each pass
        y[step:] = y[step:] + a**step * y[:-step]
        step *= 2
    return np.asarray(y)


def free_motion(x: Array, p: Array, omega: float, rate: float) -> tuple[Array, Array]:
    """CoM and its velocity that eq. 1 gives for the measured ZMP alone; only the two constants of integration are fitted to x.

    Simulating forward from a noisy start state multiplies its error by e^(w t); here the two homogeneous solutions e^(-w t) and
    e^(-w (T - t)) are fitted instead.  x, p: [m], shape (n,), no NaN.  Returns x [m] and x' [m/s], each (n,).
    """
    t = np.arange(len(x)) / rate
    basis = np.column_stack([np.exp(-omega * t), np.exp(-omega * (t[-1] - t))])
    particular, slope = bounded_motion(p, omega, rate)
    ends, *_ = np.linalg.lstsq(basis, x - particular, rcond=None)
    return np.asarray(particular + basis @ ends), np.asarray(slope + basis @ (ends * [-omega, omega]))
