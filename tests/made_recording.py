"""Plates, recordings and a swaying pendulum that the tests of the signals share."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.markerset import MarkerSet, parse
from plumbline.physics import G
from plumbline.signals import Signals, signals
from plumbline.study import Participant, Trial

Array = NDArray[np.float64]
TRIAL = Trial("sub-01_task-quiet_run-01", "sub-01", "", "quiet", "", "01", ())
SOMEBODY = Participant("sub-01", 70.0, 1.75, "M")
XYZ = ("x", "y", "z")


@dataclass
class Plate:
    time: Array
    force: Array
    cop: Array
    free_moment: Array
    corners: Array | None = None
    foot: str = ""
    number: int = 1
    moment: Array = field(init=False)

    def __post_init__(self) -> None:
        self.settle()

    def settle(self) -> None:
        """Make the moment that of the force at the CoP."""
        self.moment = np.cross(self.cop, np.nan_to_num(self.force))
        self.moment[:, 2] += self.free_moment


@dataclass
class Recording:
    time: Array
    rate: float
    markers: dict[str, Array] = field(default_factory=dict)
    filled: dict[str, Any] = field(default_factory=dict)
    derived: dict[str, Array] = field(default_factory=dict)
    plates: list[Plate] = field(default_factory=list)
    mass: float = float("nan")
    trial: Trial = TRIAL


def rod_set(**support: Any) -> MarkerSet:
    """A body of one rod from A to B."""
    rod = {"proximal": ["A"], "distal": ["B"], "mass": 1.0, "com": 0.4, "gyration": 0.3}
    return parse({"segments": {"rod": rod}, **({"support": support} if support else {})}, "rod.yaml", "rod")


def columns(frame: pd.DataFrame, name: str) -> Array:
    return frame[[f"{name}_{a}" for a in XYZ]].to_numpy(float)


def run(recording: Recording, markerset: MarkerSet | None, who: Participant = SOMEBODY, cutoff: float = 2.0) -> Signals:
    return signals(recording, who, markerset, cutoff=cutoff)


def pendulum(n: int = 3000, rate: float = 100.0, height: float = 0.95, mass: float = 70.0) -> tuple[Array, Array, Array, Array]:
    """Sway of a body without angular momentum: time, CoM, GRF, ZMP."""
    t = np.arange(n) / rate
    com, acc = np.zeros((n, 3)), np.zeros((n, 3))
    for k, tones in enumerate((((0.10, 12e-3), (0.45, 6e-3), (1.1, 2e-3)), ((0.07, 15e-3), (0.8, 3e-3)))):
        for f, size in tones:
            w = 2 * np.pi * f
            com[:, k] += size * np.sin(w * t + f)
            acc[:, k] -= size * w**2 * np.sin(w * t + f)
    com += [0.02, -0.03, height]
    zmp = np.column_stack([com[:, :2] - acc[:, :2] * height / G, np.zeros(n)])
    return t, com, mass * (acc + np.array([0.0, 0.0, G])), zmp
