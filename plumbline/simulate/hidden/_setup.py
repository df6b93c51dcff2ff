"""What a hidden effect may change before a simulation starts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from plumbline.simulate.contacts import Contact
from plumbline.simulate.control import Controller
from plumbline.simulate.jets import Array
from plumbline.simulate.posture import Habits
from plumbline.simulate.records import MarkerFault, Plate, PlateFault

FEET = tuple(side + name for side in "RL" for name in ("HEE", "TOE", "MT1", "MT5"))


@dataclass
class Setup:
    """What an effect may change.

    trials: how many are simulated at once.  rng: for phases.  duration: of the record [s].  contacts: unmeasured forces.
    force_late: how much later than the markers the plates' record is [s].  spoil_plates, spoil_markers: faults, in order.
    """

    trials: int
    rng: np.random.Generator
    habits: Habits
    controller: Controller
    duration: float = 14.0
    contacts: list[Contact] = field(default_factory=list)
    force_late: float = 0.0
    spoil_plates: list[PlateFault] = field(default_factory=list)
    spoil_markers: list[MarkerFault] = field(default_factory=list)

    def phases(self) -> Array:
        """A random phase for each trial [rad], shape (t,)."""
        return self.rng.uniform(0.0, 2 * np.pi, self.trials)

    def quirk(self, **changes: Any) -> None:
        """Change what the lateral law does beyond the clipped line."""
        self.controller = replace(self.controller, quirks=replace(self.controller.quirks, **changes))


def net_cop(plates: list[Plate]) -> tuple[Array, Array]:
    """Net centre of pressure of all plates, lateral and forward [m], each (k,)."""
    load = sum(p.force[:, 2] for p in plates)
    x, y = (sum(p.force[:, 2] * p.cop[:, i] for p in plates) / load for i in range(2))
    return np.asarray(x), np.asarray(y)


def moved(plate: Plate, right: Array | float, forward: Array | float = 0.0) -> Plate:
    """A plate whose recorded CoP is shifted [m], forces and the free moment about the CoP as they were.

    A CoP shifted by s needs the moment s x F about the same centre.
    """
    fx, fy, fz = plate.force.T
    moment = plate.moment + np.stack([forward * fz, -right * fz, right * fy - forward * fx], axis=1)
    return replace(plate, moment=moment)


def on_each(change: Callable[[Plate], Plate]) -> PlateFault:
    """The fault that changes each plate by itself."""
    return lambda plates: [change(p) for p in plates]


def beside_feet(true: Mapping[str, Array], false: dict[str, Array]) -> dict[str, Array]:
    """The false places of markers, but those of the feet true."""
    return {**false, **{label: true[label] for label in FEET if label in true}}
