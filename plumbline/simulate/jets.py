"""Second-order Taylor numbers: a quantity with its first and second time derivative, so that kinematics is written once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Jet(NamedTuple):
    """value, rate (first derivative) and change (second derivative); arrays that broadcast together."""

    value: Array
    rate: Array
    change: Array

    def plus(self, other: Jet) -> Jet:
        """Sum of two quantities."""
        return Jet(self.value + other.value, self.rate + other.rate, self.change + other.change)

    def scaled(self, factor: Array | float) -> Jet:
        """Product with a constant."""
        return Jet(factor * self.value, factor * self.rate, factor * self.change)

    def times(self, other: Jet) -> Jet:
        """Product of two quantities, (fg)'' = f''g + 2f'g' + fg''."""
        f, g = self, other
        return Jet(
            f.value * g.value,
            f.rate * g.value + f.value * g.rate,
            f.change * g.value + 2 * f.rate * g.rate + f.value * g.change,
        )

    def sin(self) -> Jet:
        """Sine of an angle [rad]."""
        s, c = np.sin(self.value), np.cos(self.value)
        return Jet(s, c * self.rate, c * self.change - s * self.rate**2)

    def cos(self) -> Jet:
        """Cosine of an angle [rad]."""
        s, c = np.sin(self.value), np.cos(self.value)
        return Jet(c, -s * self.rate, -s * self.change - c * self.rate**2)


def constant(value: Array | float) -> Jet:
    """A quantity that does not change in time."""
    v = np.asarray(value, dtype=np.float64)
    return Jet(v, np.zeros_like(v), np.zeros_like(v))
