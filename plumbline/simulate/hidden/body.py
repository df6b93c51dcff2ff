"""Hidden motions of the body and forces on it that no plate measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from plumbline.simulate.contacts import Leaning, Spring
from plumbline.simulate.hidden._setup import Setup
from plumbline.simulate.posture import Wave


def ang_mom(setup: Setup, *, amplitude: float = 0.05, frequency: float = 0.65) -> None:
    """The trunk rolls on its own rhythm, amplitude [rad], frequency [Hz]."""
    habits = setup.habits
    setup.habits = replace(habits, roll=(*habits.roll, Wave(amplitude, frequency, setup.phases())))


def height(setup: Setup, *, amplitude: float = 0.017, frequency: float = 1.0, curve: float = 0.8) -> None:
    """The knees bounce, amplitude [m], frequency [Hz], and give way by `curve` x^2 away from the middle [1/m]."""
    habits = setup.habits
    wave = Wave(amplitude, frequency, setup.phases())
    setup.habits = replace(habits, sink=(*habits.sink, wave), curve=habits.curve + curve)


def hand(setup: Setup, *, k: float = 150.0, x: float = 0.0, height: float = 1.1) -> None:
    """An unmeasured hold on something fixed: spring k [N/m] to the place x [m] at a height [m]."""
    setup.contacts.append(Spring(k, x, height))


def push(setup: Setup, *, lateral: float = 20.0, force: float = 0.0, x: float = 0.3, duration: float = 4.0, height: float = 1.2) -> None:
    """In each trial the person leans on something once for `duration` [s], at a time of its own that no events file knows.

    lateral [N] at `height` [m]; force: upwards [N] along the vertical line at x [m].
    """
    latest = max(setup.duration - duration, 0.5)
    onset = setup.rng.uniform(0.2, latest, setup.trials)
    setup.contacts.append(Leaning(np.asarray(onset), duration, lateral, height, force, x))
