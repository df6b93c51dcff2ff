"""Simulated people who stand on two force plates and are pushed by hand: recordings whose truth is known.

A body of fourteen segments (`person`, `posture`, `mechanics`) under a clipped linear law with motor noise (`control`) moves as
Newton and Euler say (`motion`); unmeasured forces are `contacts`, hidden effects `hidden`, sensors `records`. No equation that
links CoM and ZMP is used anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from plumbline.physics import G
from plumbline.simulate import hidden, records
from plumbline.simulate.contacts import Hands, Lean, Push, Spring, Touch
from plumbline.simulate.control import Controller, Law, motor_noise, together
from plumbline.simulate.jets import Array
from plumbline.simulate.mechanics import body
from plumbline.simulate.motion import FALLEN, STEP, WARM, State, World, integrate
from plumbline.simulate.person import Subject, draw_subject
from plumbline.simulate.posture import Habits, Wave, pack

__all__ = [
    "Controller", "Habits", "Law", "Lean", "Push", "SimulatedTrial", "Spring", "Subject", "Touch", "Wave",
    "draw_subject", "simulate",
]  # fmt: skip

SPARE = 0.2  # [s] lived after the record, for plates that run to the end of the last frame or are ahead of the markers


@dataclass(frozen=True)
class SimulatedTrial:
    """One recording, n frames and k plate samples, axes right, forward, up, origin between the feet.

    time: [s], (n,).  markers: label -> [m], (n, 3).  plates: right, left.  touches: the pushes by hand.  fell: whether the record
    ends in a fall.  truth: column -> (n,), without noise: time, com_*, com_dot_*, com_ddot_*, zmp_x, zmp_y, ang_mom_* (about the
    CoM), grf_* (what the feet feel), outside_x (all unmeasured forces), in SI.
    """

    subject: Subject
    run: int
    time: Array
    markers: dict[str, Array]
    plates: list[records.Plate]
    touches: list[Touch]
    fell: bool
    truth: dict[str, Array]


def simulate(
    subjects: Subject | Sequence[Subject],
    *,
    trials: int = 8,
    duration: float = 14.0,
    seed: int,
    effects: Mapping[str, Mapping[str, Any]] | None = None,
    rate: float = 200.0,
    force_rate: float = 1000.0,
    marker_noise: float = 0.7e-3,
    force_noise: float = 1.0,
    controller: Controller | Sequence[Controller] | None = None,
    habits: Habits | Sequence[Habits] | None = None,
    touches: Sequence[Sequence[Touch]] | None = None,
) -> list[SimulatedTrial]:
    """`trials` recordings of each subject, in the order of the subjects; all are simulated at once.

    duration: [s], less where somebody falls.  effects: name -> sizes, see `hidden.EFFECTS`.  rate, force_rate: [Hz].
    marker_noise [m], force_noise [N]: white, sd per coordinate and channel.  controller: everybody's, or one per subject that differ
    in their laws.  habits: prescribed motions of everybody, or one per subject that differ in `follow`.
    touches: pushes of each trial in order; drawn by `draw_touches` where not given.  Raises ValueError for limits that do not lie
    under the feet, for unknown effects, and where `touches` has another length than there are trials.
    """
    people = [subjects] if isinstance(subjects, Subject) else list(subjects)
    who = [(i, run) for i in range(len(people)) for run in range(1, trials + 1)]
    cast = [people[i] for i, _ in who]
    given = [controller or Controller()] if controller is None or isinstance(controller, Controller) else list(controller)
    setup = hidden.Setup(len(who), np.random.default_rng([seed, 0]), _habits(habits, who), given[0], duration)
    hidden.apply(setup, effects or {})
    own = [replace(setup.controller, lateral=c.lateral, forward=c.forward) for c in (given if len(given) > 1 else given * len(people))]
    _check(people, own)
    plans = _plans(people, own, who, duration, seed) if touches is None else [list(plan) for plan in touches]
    if len(plans) != len(who):
        raise ValueError(f"touches has {len(plans)} lists for {len(who)} trials; give one list per trial")
    setup.controller = together([own[i] for i, _ in who])
    world = World(body(cast, setup.habits), (Hands(plans), *setup.contacts), setup.controller)
    minds = [(own[i], [np.random.default_rng([seed, i, run, 1]) for run in range(1, trials + 1)]) for i in range(len(people))]
    motion = _live(world, cast, setup.habits, duration, minds)
    lab = _Lab(rate, force_rate, marker_noise, force_noise, setup.force_late, setup.spoil_plates, setup.spoil_markers)
    rngs = [np.random.default_rng([seed, i, run, 2]) for i, run in who]
    return lab.record(records.Lived(world, cast, setup.habits, motion), plans, [run for _, run in who], duration, rngs)


@dataclass(frozen=True)
class _Lab:
    """The laboratory: rates [Hz] and noise [m, N] of markers and plates, lateness [s] of the plates, faults of both."""

    rate: float
    force_rate: float
    marker_noise: float
    force_noise: float
    force_late: float
    faults: list[records.PlateFault]
    marker_faults: list[records.MarkerFault]

    def record(
        self,
        lived: records.Lived,
        plans: list[list[Touch]],
        runs: list[int],
        duration: float,
        rngs: list[np.random.Generator],
    ) -> list[SimulatedTrial]:
        """All trials as recorded, each to its end or fall; `rngs` make the sensors' noise."""
        frames = np.arange(round(duration * self.rate) + 1) / self.rate
        samples = np.arange(int(np.ceil(len(frames) * self.force_rate / self.rate - 1e-9))) / self.force_rate
        places, shots = lived.frames(frames)
        ground = lived.ground(samples - self.force_late)
        out = []
        for j, n in enumerate(_ends(shots["com"][0])):
            k = int(np.searchsorted(samples, n / self.rate - 1e-9))
            spots = {label: place[:, :n, j].T for label, place in places.items()}
            for fault in self.marker_faults:
                spots = fault(frames[:n], spots)
            markers = {label: spot + self.marker_noise * rngs[j].standard_normal(spot.shape) for label, spot in spots.items()}
            plates = records.plates(lived.cast[j], samples[:k], ground[:3, :k, j], ground[3:, :k, j])
            plates = records.spoilt(plates, self.faults, self.force_noise, rngs[j])
            truth = _truth(frames[:n], {name: values[:, :n, j] for name, values in shots.items()})
            fell = n < len(frames)
            out.append(SimulatedTrial(lived.cast[j], runs[j], frames[:n], markers, plates, plans[j], fell, truth))
        return out


def draw_touches(subject: Subject, controller: Controller, run: int, duration: float, seed: Sequence[int]) -> list[Touch]:
    """Three pushes of 0.25 s near 1, 5 and 9 s, about 45 to 85 % of what makes a person fall, to random sides.

    In each fourth run of five the last push is too strong (the record ends in a fall); in each fifth the first is a hand that
    leads the CoM beyond the limits and lets go while it moves back.
    """
    rng = np.random.default_rng([*seed, 3])
    law = controller.lateral
    touches: list[Touch] = []
    for i, onset in enumerate((1.0, 5.0, 9.0)):
        onset = round(onset + float(rng.uniform(0.0, 0.4)), 2)
        side, size = float(rng.choice([-1.0, 1.0])), float(rng.uniform(0.38, 0.7))
        room = law.high - law.reference if side > 0 else law.reference - law.low
        # momentum that brings the extrapolated CoM to the limit, from a pulse of mean one half, less what slowness costs
        omega = np.sqrt(G / subject.leg)
        limit = subject.mass * omega * room / (0.5 * 0.25) * np.exp(-omega * (controller.delay + controller.lag))
        if run % 5 == 4 and i == 2:
            size = 1.0
        touch: Touch = Push(onset, 0.25, round(float(side * size * limit), 1))
        if run % 5 == 0 and i == 0:
            touch = Lean(onset, 2.4, round(float(side * (room + 0.115)), 3), 0.45)
        if touch.onset + touch.duration < duration - 1.0:
            touches.append(touch)
    return touches


def _plans(
    people: Sequence[Subject], controllers: Sequence[Controller], who: Sequence[tuple[int, int]], duration: float, seed: int
) -> list[list[Touch]]:
    """Drawn touches of each trial."""
    return [draw_touches(people[i], controllers[i], run, duration, [seed, i, run]) for i, run in who]


def _habits(habits: Habits | Sequence[Habits] | None, who: Sequence[tuple[int, int]]) -> Habits:
    """One set of habits for all trials, `follow` of each subject's own."""
    if habits is None or isinstance(habits, Habits):
        return habits or Habits()
    return replace(habits[0], follow=np.array([habits[i].follow for i, _ in who]))


def _check(people: Sequence[Subject], controllers: Sequence[Controller]) -> None:
    """Limits of the ZMP must lie under the feet, else no foot could carry it."""
    for s, controller in zip(people, controllers, strict=True):
        for law, low, high in (
            (controller.lateral, -s.reach, s.reach),
            (controller.forward, -s.heel, s.lengths["foot"] - s.heel),
        ):
            if not low <= law.low < law.reference < law.high <= high:
                raise ValueError(
                    f"{s.participant_id}: ZMP limits {law.low}, {law.high} m (reference {law.reference}) "
                    f"do not lie under the feet, which reach from {low:.3f} to {high:.3f} m"
                )


def _live(
    world: World,
    cast: Sequence[Subject],
    habits: Habits,
    duration: float,
    minds: Sequence[tuple[Controller, list[np.random.Generator]]],
) -> State:
    """The motion from `WARM` before the record to its end.  minds: of each subject, with the generators of the trials' motor noise."""
    steps = int(np.ceil((WARM + duration + SPARE) / STEP))
    time = np.asarray(np.arange(steps)[:, None] * STEP - WARM, dtype=np.float64)
    noise = np.concatenate([motor_noise(rngs, controller, steps, STEP) for controller, rngs in minds], axis=2)
    return integrate(world, pack(cast, habits, time), noise, -WARM)


def _ends(com_x: Array) -> list[int]:
    """Number of frames of each trial, from its lateral CoM (n, t): all, or those before the fall."""
    fallen = np.abs(com_x) > FALLEN
    return [int(np.argmax(f)) if f.any() else len(f) for f in fallen.T]


def _truth(time: Array, shot: dict[str, Array]) -> dict[str, Array]:
    """The truth table of `SimulatedTrial`."""
    columns = {"time": time}
    names = {"com": "com", "com_rate": "com_dot", "com_change": "com_ddot", "spin": "ang_mom", "ground": "grf"}
    for name, title in names.items():
        columns |= {f"{title}_{axis}": shot[name][i] for i, axis in enumerate("xyz")}
    turn, load = shot["ground_moment"], shot["ground"][2]
    columns |= {"zmp_x": -turn[1] / load, "zmp_y": turn[0] / load, "outside_x": shot["outside"][0]}
    return columns
