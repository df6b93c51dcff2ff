r"""The paper's closed loop with prescribed omega, gains and limits: loci whose truth is known, for tests of estimators.

Plant :math:`\ddot x = \omega^2 (x - p)`, law :math:`p = \mathrm{clip}(d + k_1 (x - d) + k_2 \dot x + \eta, p_L, p_R)`
(Murai 2013), with Ornstein-Uhlenbeck feedback noise :math:`\eta` and, if wanted, the state taken a delay
earlier. All loci are integrated at once by fourth-order Runge-Kutta steps of at most 1 ms. Without noise and delay x agrees
with the closed forms (:math:`\cosh, \sinh` while saturated, the matrix exponential while not) to 1e-10 m; a crossing of a limit,
where p has a kink, adds less than 1e-6 m.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Start = Literal["saturated", "unsaturated", "beyond", "falling", "leaving"]

STEP = 1e-3  # [s] longest integration step
FALLEN = 0.3  # [m] a locus stops where the CoM is farther than this from 0


@dataclass(frozen=True)
class Locus:
    """One locus, n samples.

    time: [s], from 0.  x, p: measured CoM and ZMP [m].  x_true, v_true, p_true: without sensor noise [m, m/s, m].
    switches: instants at which the law enters or leaves saturation [s], shape (k,).  side: "left" or "right".  All (n,) but
    switches.
    """

    time: Array
    x: Array
    p: Array
    x_true: Array
    v_true: Array
    p_true: Array
    switches: Array
    side: str


@dataclass(frozen=True)
class _Loop:
    """Plant and law: omega [rad/s], k1 [1], k2 [s], limits [m], reference d [m], delay [s]."""

    omega: float
    k1: float
    k2: float
    left: float
    right: float
    d: float
    delay: float

    def wanted(self, x: Array, v: Array, noise: Array) -> Array:
        """ZMP asked for before the limits [m]."""
        return self.d + self.k1 * (x - self.d) + self.k2 * v + noise

    def slope(self, x: Array, v: Array, wanted: Array) -> Array:
        """Time derivative of (x, v), shape (2, n)."""
        return np.stack([v, self.omega**2 * (x - np.clip(wanted, self.left, self.right))])


def loci(
    n: int,
    *,
    omega: float,
    k1: float,
    k2: float,
    limits: tuple[float, float] = (-0.1, 0.1),
    d: float = 0.0,
    rate: float = 200.0,
    duration: float = 4.0,
    start: Start = "saturated",
    marker_noise: float = 1e-3,
    cop_noise: float = 1e-3,
    feedback_sd: float = 3e-3,
    feedback_time: float = 0.3,
    delay: float = 0.0,
    seed: int,
) -> list[Locus]:
    """`n` loci of the closed loop, half of them (at random) on each side.

    omega: [rad/s].  k1: [1].  k2: [s].  limits: left and right border of the ZMP [m].  d: reference [m].  rate: [Hz].
    start: "saturated" (law at its limit, recoverable), "unsaturated", "beyond" (CoM outside the limits, moving back) or
    "falling" (not recoverable; stops at |x| > 0.3 m) or "leaving" (falls too, but its law begins inside the limits: a hard push
    from the other side).  marker_noise, cop_noise: white, sd [m].  feedback_sd, feedback_time:
    sd [m] and correlation time [s] of the noise added to the wanted ZMP.  delay: age of the state in the law [s]; before the
    start the CoM is taken to have moved uniformly.  Raises ValueError where a delay is shorter than the step or no start
    state of the wanted kind exists.
    """
    rng = np.random.default_rng(seed)
    loop = _Loop(omega, k1, k2, limits[0], limits[1], d, delay)
    side = np.where(rng.random(n) < 0.5, -1.0, 1.0)
    state = _starts(loop, start, side, rng)
    parts = int(np.ceil(1.0 / (rate * STEP) - 1e-9))
    frames = round(duration * rate) + 1
    step = 1.0 / (rate * parts)
    noise = _feedback(rng, (frames - 1) * parts * 2 + 1, n, step / 2, feedback_sd, feedback_time)
    x, v, wanted = _integrate(loop, state, noise, step)
    measured = rng.standard_normal((2, frames, n)) * np.array([marker_noise, cop_noise])[:, None, None]
    return [_locus(loop, (x[:, i], v[:, i], wanted[:, i]), measured[:, :, i], step, parts, side[i]) for i in range(n)]


def _starts(loop: _Loop, kind: Start, side: Array, rng: np.random.Generator) -> Array:
    """A start state (x, v) of the wanted kind for each side, shape (2, n), drawn and kept where it is what it should be.

    The extrapolated CoM xi = x + v/omega decides: a clipped ZMP can catch it only inside the limits (Hof 2005).
    """
    ranges = {"saturated": (-0.5, 0.9, 0.5, 0.9), "unsaturated": (-0.8, 0.8, -0.6, 0.6)}
    ranges |= {"beyond": (1.05, 1.6, 0.3, 0.8), "falling": (0.2, 1.2, 1.1, 1.6), "leaving": (-1.6, -0.8, 1.02, 1.3)}
    low, high, xi_low, xi_high = ranges[kind]
    reach = np.where(side > 0, loop.right - loop.d, loop.d - loop.left)
    state = np.full((2, len(side)), np.nan)
    for _ in range(200):
        left = np.isnan(state[0])
        if not left.any():
            return state
        x = loop.d + side * reach * rng.uniform(low, high, len(side))
        xi = loop.d + side * reach * rng.uniform(xi_low, xi_high, len(side))
        v = loop.omega * (xi - x)
        pull = side * (loop.wanted(x, v, np.zeros(len(side))) - loop.d) / reach
        inside = np.abs(pull) < 0.95
        good = left & {"saturated": pull > 1.05, "unsaturated": inside, "leaving": inside}.get(kind, pull > 1.0)
        state[:, good] = np.stack([x, v])[:, good]
    raise ValueError(f"no {kind} start state exists for omega={loop.omega}, k1={loop.k1}, k2={loop.k2}")


def _feedback(rng: np.random.Generator, count: int, n: int, step: float, sd: float, time: float) -> Array:
    """Ornstein-Uhlenbeck noise, stationary from its first sample, exact on the grid of half steps, shape (count, n) [m]."""
    keep = np.exp(-step / time)
    drive = rng.standard_normal((count, n)) * np.sqrt(1 - keep**2)
    drive[0] /= np.sqrt(1 - keep**2)
    for k in range(1, count):
        drive[k] += keep * drive[k - 1]
    return np.asarray(sd * drive)


def _integrate(loop: _Loop, state: Array, noise: Array, step: float) -> tuple[Array, Array, Array]:
    """Runge-Kutta over all steps; returns x, v and the wanted ZMP at the nodes, each (steps + 1, n)."""
    steps = (len(noise) - 1) // 2
    x, v, wanted = (np.empty((steps + 1, state.shape[1])) for _ in range(3))
    past = _past(loop, x, v, state, step) if loop.delay > 0 else None
    for k in range(steps + 1):
        x[k], v[k] = state

        def slope(s: Array, half: int) -> tuple[Array, Array]:
            seen = s if past is None else past(half)
            ask = loop.wanted(seen[0], seen[1], noise[half])
            return loop.slope(s[0], s[1], ask), ask

        a, wanted[k] = slope(state, 2 * k)
        if k == steps:
            break
        b, _ = slope(state + step / 2 * a, 2 * k + 1)
        c, _ = slope(state + step / 2 * b, 2 * k + 1)
        e, _ = slope(state + step * c, 2 * k + 2)
        state = state + step / 6 * (a + 2 * b + 2 * c + e)
        # a fallen person stays where the record ends: no overflow
        state[1, np.abs(state[0]) > 2 * FALLEN] = 0.0
    return x, v, wanted


def _past(loop: _Loop, x: Array, v: Array, start: Array, step: float) -> Callable[[int], Array]:
    """The state `delay` before a half step, by cubic Hermite interpolation of the nodes passed; shape (2, n)."""
    if loop.delay < step:
        raise ValueError(f"a delay of {loop.delay} s is shorter than the integration step of {step} s; use 0 or a longer one")

    def state(half: int) -> Array:
        t = half / 2 - loop.delay / step
        if t <= 0:
            return np.stack([start[0] + start[1] * t * step, start[1]])
        j = int(np.ceil(t - 1e-9)) - 1
        s = t - j
        rise, slope = x[j + 1] - x[j] - step * v[j], step * (v[j + 1] - v[j])
        place = x[j] + step * v[j] * s + (3 * rise - slope) * s**2 + (slope - 2 * rise) * s**3
        speed = v[j] + ((6 * rise - 2 * slope) * s + 3 * (slope - 2 * rise) * s**2) / step
        return np.stack([place, speed])

    return state


def _locus(loop: _Loop, fine: tuple[Array, Array, Array], noise: Array, step: float, parts: int, side: float) -> Locus:
    """Cut one locus at its fall, take every `parts`-th node, add sensor noise, find the switches."""
    x, v, wanted = fine
    fallen = np.flatnonzero(np.abs(x) > FALLEN)
    nodes = int(fallen[0]) if len(fallen) else len(x)
    x, v, wanted = x[:nodes], v[:nodes], wanted[:nodes]
    p = np.clip(wanted, loop.left, loop.right)
    pick = slice(None, None, parts)
    frames = len(x[pick])
    return Locus(
        time=np.asarray(np.arange(frames) * step * parts, dtype=np.float64),
        x=x[pick] + noise[0, :frames],
        p=p[pick] + noise[1, :frames],
        x_true=x[pick],
        v_true=v[pick],
        p_true=p[pick],
        switches=np.sort(np.concatenate([_crossings(wanted - b, step) for b in (loop.left, loop.right)])),
        side="right" if side > 0 else "left",
    )


def _crossings(y: Array, step: float) -> Array:
    """Instants at which y changes sign, linear between nodes [s]."""
    k = np.flatnonzero(np.sign(y[:-1]) * np.sign(y[1:]) < 0)
    return np.asarray((k + y[k] / (y[k] - y[k + 1])) * step)
