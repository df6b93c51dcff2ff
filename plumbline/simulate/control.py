r"""How a simulated person decides where the ZMP shall be: a clipped linear law with motor noise, delay and lag (the truth).

.. math:: p = \mathrm{clip}(d + k_1 (x - d) + k_2 \dot x + \eta, p_{low}, p_{high})

in each horizontal direction (Murai 2013's law in the lateral one; a small stabilised sway in the forward one).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from plumbline.simulate.jets import Array

MUSCLE = 0.04  # [s] two lags in a row that make motor noise smooth, as muscles do


@dataclass(frozen=True)
class Law:
    """One direction: k1 [1], k2 [s], limits low and high [m], reference [m], motor noise sd [m] and correlation time [s]."""

    k1: float = 4.0
    k2: float = 0.9
    low: float = -0.185
    high: float = 0.185
    reference: float = 0.0
    noise: float = 3e-3
    noise_time: float = 0.3


@dataclass(frozen=True)
class Controller:
    """Both directions; delay: age of the state in the law [s]; lag: first-order lag between wanted and real ZMP [s]."""

    lateral: Law = field(default_factory=Law)
    forward: Law = field(default_factory=lambda: Law(2.0, 0.6, -0.03, 0.12, 0.045, 2e-3))
    delay: float = 0.0
    lag: float = 0.0

    def rows(self, name: str) -> Array:
        """A number of both laws, shape (2, 1, 1), lateral first."""
        return np.array([getattr(self.lateral, name), getattr(self.forward, name)])[:, None, None]

    def wanted(self, x: Array, v: Array, noise: Array) -> Array:
        """ZMP asked for [m] from CoM places [m], velocities [m/s] and noise [m], all (2, n, t)."""
        d = self.rows("reference")
        ask = d + self.rows("k1") * (x - d) + self.rows("k2") * v + noise
        return np.clip(ask, self.rows("low"), self.rows("high"))


def motor_noise(rngs: list[np.random.Generator], controller: Controller, count: int, step: float) -> Array:
    """Ornstein-Uhlenbeck noise smoothed by the muscles, stationary from the first sample, (2, count, t) [m]."""
    out = np.empty((2, count, len(rngs)))
    for axis, law in enumerate((controller.lateral, controller.forward)):
        settle = int(10 * (law.noise_time + MUSCLE) / step)
        white = np.stack([rng.standard_normal(count + settle) for rng in rngs], axis=1)
        pulse = np.zeros((settle, 1))
        pulse[0] = 1.0
        scale = law.noise / np.sqrt((_shape(pulse, law.noise_time, step) ** 2).sum())
        out[axis] = scale * _shape(white, law.noise_time, step)[settle:]
    return out


def _shape(white: Array, time: float, step: float) -> Array:
    """Three first-order filters in a row: the correlation time of the noise, then the muscles' two lags."""
    keep = np.exp(-step / np.array([time, MUSCLE, MUSCLE]))
    out = np.empty_like(white)
    a, b, c = (np.zeros_like(white[0]) for _ in range(3))
    for i, value in enumerate(white):
        a = keep[0] * a + (1 - keep[0]) * value
        b = keep[1] * b + (1 - keep[1]) * a
        out[i] = c = keep[2] * c + (1 - keep[2]) * b
    return out


class Memory:
    """What the law sees: the CoM now, or as it was `delay` earlier (cubic Hermite between the steps passed)."""

    def __init__(self, delay: float, step: float) -> None:
        """Raises ValueError for a delay between 0 and one step."""
        if 0 < delay < step:
            raise ValueError(f"a delay of {delay} s is shorter than the integration step of {step} s; use 0 or a longer one")
        self.step, self.back = step, delay / step
        self.keep = int(np.ceil(self.back)) + 1
        self.past: list[tuple[Array, Array]] = []

    def seen(self, x: Array, v: Array) -> tuple[Array, Array]:
        """Place and velocity the law is given, when the CoM is now at x with v."""
        self.past = [*self.past[-self.keep :], (x, v)] if self.past else [(x, v)] * (self.keep + 1)
        if self.back == 0.0:
            return x, v
        at = len(self.past) - 1 - self.back
        j = min(int(at), len(self.past) - 2)
        s, h = at - j, self.step
        (x0, v0), (x1, v1) = self.past[j], self.past[j + 1]
        rise, bow = x1 - x0 - h * v0, h * (v1 - v0)
        place = x0 + h * v0 * s + (3 * rise - bow) * s**2 + (bow - 2 * rise) * s**3
        return place, v0 + ((6 * rise - 2 * bow) * s + 3 * (bow - 2 * rise) * s**2) / h
