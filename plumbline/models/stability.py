r"""Whether somebody can stay standing without a step: extrapolated CoM, margin of stability, and the step that is missing.

Of an inverted pendulum, :math:`\ddot x = \omega^2 (x - p)`, the part that grows is

.. math:: \xi = x + \dot x / \omega, \qquad \dot\xi = \omega (\xi - p),

the extrapolated CoM (Hof 2005, eq. 5), also called the capture point: a pendulum put on :math:`p = \xi` comes to rest over it. While
:math:`\xi` lies inside the support, some CoP there brings the body back; the distance to the border is the margin of stability
(Hof 2005, eq. 8). Outside no CoP does, and the foot has to go at least as far as :math:`\xi` is out: that step is what is shown of a
standing-up. It is the step with everything else let go; a hand or a seat that bears weight widens the support, and no margin to the
feet knows of it.

Hof takes omega from the leg's length, 1.34 of the height of the trochanter; here it is the subject's own, identified or from the
height of the own CoM. Too low a CoM makes omega too large and :math:`\xi` too near.

Hof AL, Gazendam MGJ, Sinke WE (2005) The condition for dynamic stability. J Biomech 38:1-8. Gonzalez A et al. (2013), fig. 4.
"""

import numpy as np
from numpy.typing import NDArray

from plumbline.errors import PlumblineError
from plumbline.physics import G

Array = NDArray[np.float64]


def natural(z: Array, z_ddot: Array | float = 0.0) -> Array:
    """omega = sqrt((g + z'')/z) [rad/s], (n,): NaN while nothing is borne.  z: height over the support [m], (n,).  z_ddot [m/s2]."""
    with np.errstate(invalid="ignore", divide="ignore"):
        w2 = (G + np.asarray(z_ddot)) / z
    return np.sqrt(np.where(w2 > 0, w2, np.nan))


def extrapolated(x: Array, v: Array, omega: Array | float) -> Array:
    """Extrapolated CoM (capture point) xi = x + v/omega [m], (n,).  x [m], v [m/s]: (n,).  omega [rad/s]: one, or (n,).

    Raises PlumblineError where an omega is not positive.
    """
    if np.any(np.asarray(omega) <= 0):
        raise PlumblineError(f"omega has to be positive, not {np.nanmin(omega):g} rad/s")
    return np.asarray(x + v / omega)


def margin(xi: Array, low: Array | float, high: Array | float) -> Array:
    """Margin of stability [m], (n,): how far xi is from the nearer border, negative outside.  low, high: borders [m]."""
    return np.asarray(np.minimum(xi - low, high - xi))


def margin_in(xi: Array, corners: Array) -> Array:
    """Margin of stability in a convex outline [m], (n,): distance to the nearest edge, negative outside.

    xi: (n, 2) [m].  corners: in either turn (k, 2) [m].  Outside it is the largest distance from a line through an edge: the least that
    the outline would have to grow.
    """
    edge = np.roll(corners, -1, axis=0) - corners
    area = float(np.sum(corners[:, 0] * np.roll(corners[:, 1], -1) - corners[:, 1] * np.roll(corners[:, 0], -1)))
    inward = np.sign(area) * np.column_stack([-edge[:, 1], edge[:, 0]]) / np.linalg.norm(edge, axis=1, keepdims=True)
    return np.asarray(np.min(np.einsum("nki,ki->nk", xi[:, None] - corners[None], inward), axis=1))


def step(xi: Array, low: Array | float, high: Array | float) -> Array:
    """The step that is missing [m], (n,): from the border to xi, signed; 0 while xi is inside.  low, high: borders [m]."""
    return np.asarray(np.maximum(xi - high, 0.0) - np.maximum(low - xi, 0.0))


def speed(x: Array, time: Array, half: float) -> Array:
    """x' [m/s], (n,): slope of a straight line through what lies within `half` [s], NaN nearer than that to an end.

    x [m], time [s], even: (n,).  Noise of sd s makes it uncertain by s sqrt(3/k)/half, with k samples in reach.
    """
    step_ = float(np.median(np.diff(time)))
    k = max(round(half / step_), 1)
    out = np.full(len(x), np.nan)
    if len(x) > 2 * k:
        weights = np.arange(-k, k + 1) / (step_ * np.sum(np.arange(-k, k + 1) ** 2))
        out[k:-k] = np.correlate(x, weights, mode="valid")
    return out
