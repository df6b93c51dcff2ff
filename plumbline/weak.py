r"""Weak form: a differential equation tested with compact bumps, so that no measured signal is ever differentiated.

Multiply :math:`\ddot x = \omega^2 (x - p)` by a bump :math:`f` and integrate by parts twice; the ends vanish:

.. math:: \int \ddot f\, x\, dt = \omega^2 \int f\, (x - p)\, dt

The bump is :math:`f(s) = (1 - s^2)^k` with :math:`s = (t - t_c)/h`. On a grid the integrals are sums, and sampled derivatives of
:math:`f` no longer annihilate constants and lines exactly; they are re-normalised so that polynomials up to degree 2 are
integrated exactly (else gravity's :math:`z''` and the CoM's mean leak in).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SAMPLES = 4  # on each side of the centre: fewer cannot carry a second derivative
NORMAL = 0.6744897501960817  # median absolute value of a standard normal variable


@dataclass(frozen=True)
class Bump:
    """Test function (1 - s^2)^exponent of half width `half_width` [s] on a grid of `rate` [Hz].

    Raises ValueError where fewer than nine samples fall on the bump: derivatives of f would be meaningless.
    """

    half_width: float
    exponent: int
    rate: float

    def __post_init__(self) -> None:
        if self.reach < SAMPLES:
            raise ValueError(f"half width {self.half_width} s holds only {self.reach} samples at {self.rate} Hz, needs {SAMPLES}")

    @property
    def reach(self) -> int:
        """Samples on each side of the centre."""
        return int(np.floor(self.half_width * self.rate + 1e-9))

    @cached_property
    def _s(self) -> Array:
        return np.arange(-self.reach, self.reach + 1) / (self.half_width * self.rate)

    @cached_property
    def value(self) -> Array:
        """Weights of the mean, shape (2 reach + 1,); they sum to 1."""
        f = np.clip(1.0 - self._s**2, 0.0, None) ** self.exponent
        return np.asarray(f / f.sum())

    @cached_property
    def slope(self) -> Array:
        """Weights of the first derivative [1/s]: -f' dt, exact on polynomials of degree 2."""
        k, s = self.exponent, self._s
        g = 2.0 * k * s * np.clip(1.0 - s**2, 0.0, None) ** (k - 1)
        t = s * self.half_width
        return np.asarray(g / (g @ t))

    @cached_property
    def curvature(self) -> Array:
        """Weights of the second derivative [1/s2]: f'' dt, exact on polynomials of degree 3."""
        k, s = self.exponent, self._s
        inside = np.clip(1.0 - s**2, 0.0, None)
        g = 4.0 * k * (k - 1) * s**2 * inside ** (k - 2) - 2.0 * k * inside ** (k - 1)
        g = g - self.value * g.sum()  # sum f'' = 0 exactly, with a correction that is smooth and compact
        t = s * self.half_width
        return np.asarray(g / (g @ t**2 / 2.0))

    def apply(self, weights: Array, signal: Array) -> Array:
        """sum_j weights_j signal(t + t_j) at each sample; NaN where the bump leaves the record or meets a NaN.

        weights: (2 reach + 1,).  signal: (n,) or (n, d).  Returns the signal's shape.
        """
        x = np.asarray(signal, dtype=float)
        columns = x.reshape(len(x), -1)
        out = np.full(columns.shape, np.nan)
        for k in range(columns.shape[1]) if len(x) >= len(weights) else ():
            bad = ~np.isfinite(columns[:, k])
            if not bad.all():
                centre = columns[~bad, k].mean()  # far origins cost digits; a constant is put back exactly
                body = np.convolve(np.where(bad, 0.0, columns[:, k] - centre), weights[::-1], mode="valid") + centre * weights.sum()
                out[self.reach : len(x) - self.reach, k] = np.where(self._touches(bad), np.nan, body)
        return out.reshape(x.shape)

    def _touches(self, bad: Mask) -> Mask:
        count = np.concatenate([[0], np.cumsum(bad)])
        width = 2 * self.reach + 1
        return np.asarray(count[width:] - count[:-width] > 0)

    def mean(self, signal: Array) -> Array:
        """Bump-weighted mean around each sample."""
        return self.apply(self.value, signal)

    def derivative(self, signal: Array) -> Array:
        """Bump-weighted first derivative [1/s]."""
        return self.apply(self.slope, signal)

    def second(self, signal: Array) -> Array:
        """Bump-weighted second derivative [1/s2]."""
        return self.apply(self.curvature, signal)


def white_noise_sd(signal: Array) -> Array:
    """Standard deviation of the white noise in each column, from fourth differences (motion up to cubic drops out).

    signal: (n,) or (n, d), NaN allowed.  Returns () or (d,).  The sum of squared binomials (1, 4, 6, 4, 1) is 70. The median
    keeps single contacts and pushes out.
    """
    d = np.diff(np.asarray(signal, dtype=float).reshape(len(signal), -1), n=4, axis=0)
    out = np.full(d.shape[1], np.nan)
    for k in range(d.shape[1]):
        known = d[np.isfinite(d[:, k]), k]
        if len(known):
            out[k] = np.median(np.abs(known)) / NORMAL / np.sqrt(70.0)
    return out.reshape(np.shape(signal)[1:])
