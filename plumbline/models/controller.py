r"""The controller of Murai 2013: a linear law, clipped by what the feet can do.

.. math:: x_Z = \mathrm{clip}\bigl(d + k_1 (x - d) + k_2 \dot x,\; x_{Z,L},\; x_{Z,R}\bigr) \qquad \text{(4), (5)}

Inside the limits (region S2) the closed loop has the poles :math:`-\omega q_1, -\omega q_2` with

.. math:: k_1 = q_1 q_2 + 1, \qquad k_2 = (q_1 + q_2)/\omega. \qquad \text{(7)}
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Law(NamedTuple):
    """Reference d [m], gains k1 [1] and k2 [s], left and right limit of the ZMP [m] (infinite where never reached), delay [s]."""

    d: float
    k1: float
    k2: float
    left: float = -np.inf
    right: float = np.inf
    delay: float = 0.0

    def wanted(self, x: Array, v: Array) -> Array:
        """ZMP asked for, before the limits, d + k1 (x - d) + k2 x' [m].  x [m], v [m/s]: CoM and its velocity, any shape."""
        return np.asarray(self.d + self.k1 * (x - self.d) + self.k2 * v)

    def zmp(self, x: Array, v: Array) -> Array:
        """ZMP that the law gives within its limits [m] (eq. 4)."""
        return np.clip(self.wanted(x, v), self.left, self.right)

    def region(self, x: Array, v: Array) -> NDArray[np.int8]:
        """-1 where the law holds the ZMP at its left limit, +1 at its right one, 0 inside."""
        wanted = self.wanted(x, v)
        return np.asarray((wanted >= self.right).astype(np.int8) - (wanted <= self.left))


def poles(k1: float, k2: float, omega: float) -> tuple[complex, complex]:
    """q1, q2 of eq. 7: roots of q^2 - omega k2 q + (k1 - 1); the poles are -omega q [1/s].  Complex for underdamped people."""
    half = omega * k2 / 2
    root = np.sqrt(complex(half**2 - (k1 - 1)))
    return complex(half + root), complex(half - root)


def gains(q1: complex, q2: complex, omega: float) -> tuple[float, float]:
    """k1 [1] and k2 [s] of eq. 7.  Raises ValueError where q1, q2 are neither both real nor conjugate."""
    k1, k2 = q1 * q2 + 1, (q1 + q2) / omega
    if abs(complex(k1).imag) + abs(complex(k2).imag) > 1e-9:
        raise ValueError(f"q1 = {q1}, q2 = {q2}: two real numbers or a conjugate pair are needed")
    return float(complex(k1).real), float(complex(k2).real)


def damping(k1: float, k2: float, omega: float) -> float:
    """Damping ratio of the closed loop inside the limits [1], omega k2 / (2 sqrt(k1 - 1)); NaN where k1 <= 1 (no return)."""
    return float(omega * k2 / (2 * np.sqrt(k1 - 1))) if k1 > 1 else float("nan")
