r"""How a simulated person decides where the ZMP shall be: a clipped linear law with motor noise, delay and lag (the truth).

.. math:: p = \mathrm{clip}(d + k_1 (x - d) + k_2 \dot x + \eta, p_{low}, p_{high})

in each horizontal direction (Murai 2013's law in the lateral one; a small stabilised sway in the forward one). What a law may
do beyond that (`Quirks`) acts in the lateral direction only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from plumbline.simulate.jets import Array

MUSCLE = 0.04  # [s] two lags in a row that make motor noise smooth, as muscles do


@dataclass(frozen=True)
class Law:
    """One direction: k1 [1], k2 [s], limits low and high [m], reference [m], motor noise sd [m] and correlation time [s].

    The first five may differ between trials that are simulated at once: arrays (t,), made by `together`.
    """

    k1: Array | float = 4.0
    k2: Array | float = 0.9
    low: Array | float = -0.185
    high: Array | float = 0.185
    reference: Array | float = 0.0
    noise: float = 3e-3
    noise_time: float = 0.3


@dataclass(frozen=True)
class Quirks:
    r"""What the lateral law does beyond the clipped line, with :math:`e = x - d` and :math:`v = \dot x` as the law sees them.

    dead: half width x0 of the dead zone [m].  zone: "soft" e becomes 0 inside and e - x0 sign(e) outside; "jump" it is whole
    outside; "hold" where abs(e + v / w) < x0 the ZMP stays where it was (w = 3 rad/s), motor noise included.
    drift: of the reference from the record's start [m/s].  kappa [1], beta [s]: a part without delay, added before the limits.
    integral: factor on the integral of e [1/s].  sensed, sensed_time: sd [m] and correlation time [s] of noise on x (its rate on
    v).  knee: width over which the limits are rounded [m].  sway, sway_rate: a rhythm of the reference [m], [Hz].
    lopsided: k1 is (1 + lopsided) k1 on the right.  bend: k1 e becomes k1 e (1 - (e / bend)^2) [m], 0 for none.
    """

    dead: float = 0.0
    zone: str = "soft"
    drift: float = 0.0
    kappa: float = 0.0
    beta: float = 0.0
    integral: float = 0.0
    sensed: float = 0.0
    sensed_time: float = 0.1
    knee: float = 0.0
    sway: float = 0.0
    sway_rate: float = 0.4
    lopsided: float = 0.0
    bend: float = 0.0


@dataclass(frozen=True)
class Controller:
    """Both directions; delay: age of the state in the law [s]; lag: first-order lag between wanted and real ZMP [s].

    clip_last: the limits act on what the lag has left, not on what goes into it.
    """

    lateral: Law = field(default_factory=Law)
    forward: Law = field(default_factory=lambda: Law(2.0, 0.6, -0.03, 0.12, 0.045, 2e-3))
    delay: float = 0.0
    lag: float = 0.0
    clip_last: bool = False
    quirks: Quirks = field(default_factory=Quirks)

    def rows(self, name: str) -> Array:
        """A number of both laws, shape (2, 1, 1) or (2, 1, t), lateral first."""
        return self._rows[name]

    @cached_property
    def _rows(self) -> dict[str, Array]:
        """All rows, as they are asked for at each step."""

        def both(name: str) -> Array:
            return np.stack(np.broadcast_arrays(getattr(self.lateral, name), getattr(self.forward, name))).reshape(2, 1, -1)

        return {name: both(name) for name in ("k1", "k2", "low", "high", "reference")}

    def wanted(self, x: Array, v: Array, noise: Array) -> Array:
        """ZMP asked for [m] from CoM places [m], velocities [m/s] and noise [m], all (2, n, t): the clipped line alone."""
        d = self.rows("reference")
        return self.limited(d + self.rows("k1") * (x - d) + self.rows("k2") * v + noise)

    def limited(self, ask: Array) -> Array:
        """The asked ZMP within the limits [m], (2, n, t); rounded by the knee in the lateral direction."""
        low, high, knee = self.rows("low"), self.rows("high"), self.quirks.knee
        out = np.clip(ask, low, high)
        if knee > 0:
            # integral of a smooth box: slope 1 well inside, 0 well outside, both limits kept
            soft = np.logaddexp(0.0, (ask[0] - low[0]) / knee) - np.logaddexp(0.0, (ask[0] - high[0]) / knee)
            out[0] = low[0] + knee * soft
        return out

    def lagging(self, zmp: Array) -> Array:
        """ZMP on the ground from the state of the lag [m], (2, n, t)."""
        return self.limited(zmp) if self.clip_last else zmp


def together(controllers: Sequence[Controller]) -> Controller:
    """One controller for t trials that has the laws of t controllers; all else is the first one's."""

    def joined(laws: Sequence[Law]) -> Law:
        def each(name: str) -> Array:
            return np.array([getattr(law, name) for law in laws])

        return Law(each("k1"), each("k2"), each("low"), each("high"), each("reference"))

    return replace(controllers[0], lateral=joined([c.lateral for c in controllers]), forward=joined([c.forward for c in controllers]))


def motor_noise(rngs: list[np.random.Generator], controller: Controller, count: int, step: float) -> Array:
    """Noise on the wanted ZMP [m], stationary from the first sample, (2, count, t): motor noise, and what noise of the senses makes.

    Motor noise is Ornstein-Uhlenbeck noise smoothed by the muscles. Noise n of the senses enters a linear law as k1 n + k2 n'.
    """
    out = np.stack([_coloured(rngs, law.noise, law.noise_time, count, step) for law in (controller.lateral, controller.forward)])
    quirks, law = controller.quirks, controller.lateral
    if quirks.sensed > 0:
        n = _coloured(rngs, quirks.sensed, quirks.sensed_time, count, step)
        out[0] += law.k1 * n + law.k2 * np.gradient(n, step, axis=0)
    return out


def _coloured(rngs: list[np.random.Generator], size: float, time: float, count: int, step: float) -> Array:
    """Smooth noise of a standard deviation and a correlation time [s], (count, t)."""
    settle = int(10 * (time + MUSCLE) / step)
    white = np.stack([rng.standard_normal(count + settle) for rng in rngs], axis=1)
    pulse = np.zeros((settle, 1))
    pulse[0] = 1.0
    scale = size / np.sqrt((_shape(pulse, time, step) ** 2).sum())
    return np.asarray(scale * _shape(white, time, step)[settle:])


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


class Mind:
    """The law in time: asked once per step, in order, as it remembers."""

    HOLD_RATE = 3.0  # [rad/s] makes a place of a velocity in a zone of "hold"

    def __init__(self, controller: Controller, step: float) -> None:
        self.controller, self.step = controller, step
        self.memory = Memory(controller.delay, step)
        self.sum: Array | float = 0.0  # of x - d over time [m s]
        self.last: Array | None = None
        self.plain = controller.quirks == Quirks(knee=controller.quirks.knee)

    def ask(self, time: float, x: Array, v: Array, noise: Array) -> Array:
        """ZMP asked for [m], (2, 1, t), at a time [s] from the CoM now [m, m/s] and noise [m]; within the limits unless they act last."""
        c, d = self.controller, self.controller.rows("reference")
        old, rate = self.memory.seen(x, v)
        ask = d + c.rows("k1") * (old - d) + c.rows("k2") * rate + noise
        if not self.plain:
            ask[0] = self._lateral(time, x[0], v[0], old[0], rate[0]) + noise[0]
        limits_later = c.clip_last and c.lag > 0
        return self._held(ask if limits_later else c.limited(ask), old[0] - d[0], rate[0])

    def _lateral(self, time: float, x: Array, v: Array, old: Array, rate: Array) -> Array:
        """The lateral law with its quirks, before noise and limits [m], (1, t)."""
        q, law = self.controller.quirks, self.controller.lateral
        d = law.reference + q.drift * max(time, 0.0) + q.sway * np.sin(2 * np.pi * q.sway_rate * time)
        e = old - d
        self.sum = self.sum + self.step * e
        k1 = law.k1 * np.where(e > 0, 1 + q.lopsided, 1.0) * (1 - (e / q.bend) ** 2 if q.bend > 0 else 1.0)
        if q.zone == "soft":
            e = e - np.clip(e, -q.dead, q.dead)
        elif q.zone == "jump":
            e = np.where(np.abs(e) < q.dead, 0.0, e)
        return np.asarray(d + k1 * e + law.k2 * rate + q.integral * self.sum + q.kappa * (x - d) + q.beta * v)

    def _held(self, ask: Array, e: Array, rate: Array) -> Array:
        """The last ZMP where a zone of "hold" keeps it."""
        q = self.controller.quirks
        if q.zone != "hold" or q.dead == 0.0:
            return ask
        if self.last is not None:
            ask[0] = np.where(np.abs(e + rate / self.HOLD_RATE) < q.dead, self.last, ask[0])
        self.last = ask[0].copy()
        return ask
