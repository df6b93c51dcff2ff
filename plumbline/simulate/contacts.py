"""Forces on the body that no plate measures: hands that push, hands that guide, springs.

A contact gives its force [N] and the line along which it acts [m], from the time and from where the body is. New kinds (walls,
periodic forces, ...) are new classes with the same method, or a `Field`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from plumbline.simulate.jets import Array

STIFF, DAMP = 3000.0, 850.0  # [N/m, N s/m] of a hand that guides somebody


class Where(NamedTuple):
    """What a contact can feel: time [s]; CoM and the trunk's point under the hand, lateral [m] and its velocity; its height [m].

    Arrays (n, t), time (n, 1).
    """

    time: Array
    com: Array
    com_rate: Array
    hand: Array
    hand_rate: Array
    hand_height: Array


class Pull(NamedTuple):
    """A force on the body: lateral [N] at a height [m], and up [N] at a lateral place [m]."""

    lateral: Array
    height: Array | float
    up: Array | float = 0.0
    place: Array | float = 0.0


class Contact(Protocol):
    """One unmeasured force."""

    def force(self, at: Where) -> Pull:
        """Force and where it acts."""


class Push(NamedTuple):
    """A push by hand: onset [s], duration [s], peak [N] of a smooth pulse, right positive."""

    onset: float
    duration: float
    peak: float


class Lean(NamedTuple):
    """A hand leads the trunk aside by `reach` [m, right positive], and lets go while it moves back at `speed` [m/s]."""

    onset: float
    duration: float
    reach: float
    speed: float


Touch = Push | Lean


class Hands:
    """The pushes and leans of t trials."""

    def __init__(self, plans: list[list[Touch]]) -> None:
        most = max((len(p) for p in plans), default=0)
        self.slots = [[plan[i] if i < len(plan) else Push(0.0, 1.0, 0.0) for plan in plans] for i in range(most)]

    def force(self, at: Where) -> Pull:
        """Sum over the touches of each trial [N], at the height of the hand on the trunk [m]."""
        total = np.zeros_like(at.com)
        for slot in self.slots:
            start = np.array([t.onset for t in slot])
            s = (at.time - start) / np.array([t.duration for t in slot])
            on = (s > 0) & (s < 1)
            if on.any():
                total = total + np.where(on, _touch(slot, s, at), 0.0)
        return Pull(total, at.hand_height)


def _touch(slot: list[Touch], s: Array, at: Where) -> Array:
    """Force of the touches of a slot at their relative times s (0 to 1) [N]."""
    peak = np.array([t.peak if isinstance(t, Push) else 0.0 for t in slot])
    force = peak * np.sin(np.pi * s) ** 2
    if all(isinstance(t, Push) for t in slot):
        return np.asarray(force)
    reach = np.array([t.reach if isinstance(t, Lean) else 0.0 for t in slot])
    speed = np.array([t.speed if isinstance(t, Lean) else 0.0 for t in slot])
    time = np.array([t.duration for t in slot])
    out, back = np.clip(s / 0.5, 0, 1), np.clip((s - 0.875) / 0.125, 0, 1)
    # fifth-order rise over the first half, then in the last eighth a steady acceleration back to `speed`
    place = reach * out**3 * (10 - 15 * out + 6 * out**2) - np.sign(reach) * speed * back**2 * time / 16
    rate = reach * 30 * out**2 * (1 - out) ** 2 / (0.5 * time) - np.sign(reach) * speed * back
    grip = np.sin(np.pi * np.clip(np.minimum(s, 1 - s) / 0.05, 0, 1) / 2) ** 2
    guide = grip * (STIFF * (place - at.hand) + DAMP * (rate - at.hand_rate))
    return np.asarray(force + np.where(reach != 0, guide, 0.0))


@dataclass(frozen=True)
class Spring:
    """A hold on something fixed: force -stiffness (x - place), x the CoM as in the catalogue of effects, at a height [m]."""

    stiffness: float  # [N/m]
    place: float  # [m]
    height: float  # [m]

    def force(self, at: Where) -> Pull:
        """Force and where it acts."""
        return Pull(-self.stiffness * (at.com - self.place), self.height)


@dataclass(frozen=True)
class Field:
    """A lateral force that is a function of time and of where the CoM is, at a height [m].

    law: (time [s], x [m], x' [m/s]) -> [N]; arrays that broadcast to (n, t).
    """

    law: Callable[[Array, Array, Array], Array]
    height: float

    def force(self, at: Where) -> Pull:
        """Force and where it acts."""
        return Pull(self.law(at.time, at.com, at.com_rate), self.height)


@dataclass(frozen=True)
class Leaning:
    """Somebody leans on something for a while, or is held: a force that rises, stays and goes, in each trial at its own time.

    onset: [s], (t,).  duration: [s].  lateral: [N] at `height` [m].  up: [N] at `place` [m].  edge: of the rise and the fall [s].
    """

    onset: Array
    duration: float
    lateral: float
    height: float
    up: float = 0.0
    place: float = 0.0
    edge: float = 0.4

    def force(self, at: Where) -> Pull:
        """Force and where it acts."""
        since = at.time - self.onset
        s = np.clip(np.minimum(since, self.duration - since) / self.edge, 0.0, 1.0)
        share = s**3 * (10 - 15 * s + 6 * s**2) + 0 * at.com
        return Pull(self.lateral * share, self.height, self.up * share, self.place)
