"""Hidden effects: what a study has and the plain model lacks. Each is one function that changes the set-up of a simulation.

A new effect is a new function in `EFFECTS`; it may change the habits, the controller, add contacts or spoil the records.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from plumbline.simulate.contacts import Contact, Spring
from plumbline.simulate.control import Controller
from plumbline.simulate.jets import Array
from plumbline.simulate.posture import Habits, Wave

Spoil = Callable[[Array, Array], Array]


@dataclass
class Setup:
    """What an effect may change.

    trials: how many are simulated at once.  rng: for phases.  contacts: unmeasured forces.  force_late: how much later than the
    markers the plates' record is [s].  spoil_plates: functions (wrench, centre) -> wrench on a plate's record, wrench (n, 6) =
    force and moment about the plate's centre [N, N m], centre (3,) [m].
    """

    trials: int
    rng: np.random.Generator
    habits: Habits
    controller: Controller
    contacts: list[Contact] = field(default_factory=list)
    force_late: float = 0.0
    spoil_plates: list[Spoil] = field(default_factory=list)

    def phases(self) -> Array:
        """A random phase for each trial [rad], shape (t,)."""
        return self.rng.uniform(0.0, 2 * np.pi, self.trials)


def ang_mom(setup: Setup, *, amplitude: float = 0.05, frequency: float = 0.65) -> None:
    """The trunk rolls on its own rhythm, amplitude [rad], frequency [Hz]."""
    habits = setup.habits
    setup.habits = replace(habits, roll=(*habits.roll, Wave(amplitude, frequency, setup.phases())))


def height(setup: Setup, *, amplitude: float = 0.017, frequency: float = 1.0, curve: float = 0.8) -> None:
    """The knees bounce, amplitude [m], frequency [Hz], and give way by `curve` x^2 away from the middle [1/m]."""
    habits = setup.habits
    wave = Wave(amplitude, frequency, setup.phases())
    setup.habits = replace(habits, sink=(*habits.sink, wave), curve=habits.curve + curve)


def sync(setup: Setup, *, delay: float = 0.016) -> None:
    """The force record is late by `delay` [s]."""
    setup.force_late += delay


def delay(setup: Setup, *, delay: float = 0.08) -> None:
    """The law acts on the state `delay` ago [s]."""
    setup.controller = replace(setup.controller, delay=setup.controller.delay + delay)


def offset(setup: Setup, *, b: float = 0.005, forward: float = 0.0) -> None:
    """Plates record a CoP too far right by b and too far forward by `forward` [m]."""

    def spoil(wrench: Array, centre: Array) -> Array:
        # a CoP shifted by s needs the moment s x F about the same centre; only its horizontal part moves the CoP
        out = wrench.copy()
        out[:, 3] += forward * wrench[:, 2]
        out[:, 4] -= b * wrench[:, 2]
        out[:, 5] += b * wrench[:, 1] - forward * wrench[:, 0]
        return out

    setup.spoil_plates.append(spoil)


def hand(setup: Setup, *, k: float = 150.0, x: float = 0.0, height: float = 1.1) -> None:
    """An unmeasured hold on something fixed: spring k [N/m] to the place x [m] at a height [m]."""
    setup.contacts.append(Spring(k, x, height))


EFFECTS: dict[str, Callable[..., None]] = {f.__name__: f for f in (ang_mom, height, sync, delay, offset, hand)}


def apply(setup: Setup, effects: Mapping[str, Mapping[str, Any]]) -> None:
    """Apply effects by name with their sizes; raises ValueError for an unknown name."""
    for name, sizes in effects.items():
        if name not in EFFECTS:
            raise ValueError(f"no hidden effect is called {name!r}; there are {', '.join(EFFECTS)}")
        EFFECTS[name](setup, **sizes)
