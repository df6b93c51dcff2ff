"""A long calibration of a nine-segment person: slow moves and holds with a seat, a released hand and three handle heights.

No paper: the protocol that the guidance of a personal centre of mass asks for, after Gonzalez et al. (2013), whose own keeps feet and
hands fixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from plumbline.simulate import nine_segments as nine
from plumbline.simulate import tasks
from plumbline.simulate.multi_contact import HANDLE, HEIGHTS, READY, SEAT, STAND, Motion, ankles, grips, jerkless, seat, soles, start, times
from plumbline.simulate.nine_segments import Array
from plumbline.simulate.tasks import Pose, Target

KNOT = 0.25  # [s] between the poses that are worked out
RAMP = 0.5  # [s] in which a contact takes its load


class Way(NamedTuple):
    """A pose to go to and hold.

    pelvis [m].  trunk: degrees about x (backward), y (to the right), z (to the left).  left, right: where the hand is: the height of its
    handle [m], or a place from its shoulder (outward, forward, up) [m].  seated: weight on the seat.
    """

    pelvis: tuple[float, float, float]
    trunk: tuple[float, float, float] = (0.0, 0.0, 0.0)
    left: float | tuple[float, float, float] = HEIGHTS[1]
    right: float | tuple[float, float, float] = HEIGHTS[1]
    seated: bool = False


LOW, MIDDLE, HIGH = HEIGHTS
OUT, UP, AHEAD = (0.45, 0.10, 0.10), (0.10, 0.15, 0.50), (0.05, 0.50, 0.05)  # [m] a free hand from its shoulder: outward, forward, up


def _round(height: float) -> list[Way]:
    """Standing at handles of one height: both hands, squat, lean, either side, either hand free."""
    x, y, z = STAND
    return [
        Way(STAND, (0.0, 0.0, 0.0), height, height),
        Way((x, y - 0.10, z - 0.17), (-20.0, 0.0, 0.0), height, height),
        Way((x, y - 0.08, z), (-30.0, 0.0, 0.0), height, height),
        Way((x - 0.08, y, z), (-5.0, -8.0, 0.0), height, height),
        Way((x + 0.08, y, z), (-5.0, 8.0, 15.0), height, height),
        Way(STAND, (0.0, 0.0, 0.0), OUT if height < HIGH else UP, height),
        Way(STAND, (-10.0, 0.0, 0.0), height, AHEAD if height > LOW else UP),
    ]


EXTENDED = (
    *_round(MIDDLE),
    *_round(LOW),
    *_round(HIGH),
    Way(SEAT, (-35.0, 0.0, 0.0), HIGH, HIGH, True),
    Way(SEAT, (-30.0, 0.0, 0.0), MIDDLE, MIDDLE, True),
    Way(SEAT, (-45.0, 0.0, 0.0), LOW, LOW, True),
    Way(SEAT, (-30.0, 0.0, 0.0), UP, MIDDLE, True),
    Way(SEAT, (-30.0, 0.0, 0.0), MIDDLE, OUT, True),
    Way(SEAT, (10.0, 0.0, 0.0), AHEAD, AHEAD, True),
    Way(SEAT, (0.0, -10.0, 0.0), UP, UP, True),
    Way(SEAT, (0.0, 10.0, 0.0), OUT, OUT, True),
)


def extended(rate: float = 100.0, ways: Sequence[Way] | None = None, move: float = 4.0, hold: float = 6.0) -> Motion:
    """Slow moves and holds with a seat, each hand released in turn, three handle heights and a leaning trunk; 290 s with the own list.

    rate [Hz].  ways: poses to go to.  move, hold: how long each takes and is held [s].
    """
    route = list(EXTENDED if ways is None else ways)
    time = times(len(route) * (move + hold), rate)
    places = np.array([[_hand(w, side) for side in (-1, 1)] for w in route])
    knots = np.append(np.arange(0.0, time[-1], KNOT), time[-1])
    pose = tasks.interpolated(_solved(route, places, knots, move, hold), knots, time)
    hands = _hands(places, time, move, hold)
    pose = tasks.polish(pose, ankles(len(time)) + hands)
    held = [[isinstance(w.left, float), isinstance(w.right, float), w.seated] for w in route]
    loads = [_load(places[:, i], [h[i] for h in held], time, move, hold) for i in range(2)]
    sat = _load(np.array([w.pelvis for w in route]), [h[2] for h in held], time, move, hold, still=False)
    return Motion(time, pose, (*soles(len(time)), seat(len(time), sat)), grips(hands, loads))


def _solved(route: Sequence[Way], places: Array, knots: Array, move: float, hold: float) -> Pose:
    """The pose at every knot [s]; each different one is worked out once."""
    targets = [np.array([w.pelvis for w in route]), np.array([w.trunk for w in route]), places[:, 0], places[:, 1]]
    path = np.round(np.hstack([_along(points, knots, move, hold) for points in targets]), 9)
    _, once, which = np.unique(path, axis=0, return_index=True, return_inverse=True)
    rows = np.asarray(path[once], dtype=np.float64)
    pelvis, trunk, left, right = rows[:, :3], rows[:, 3:6], rows[:, 6:9], rows[:, 9:]
    wanted = np.tile(tasks.posed(READY), (len(rows), 1, 1, 1))
    wanted[:, 0] = Rotation.from_euler("xyz", trunk, degrees=True).as_matrix()
    contacts = [*ankles(len(rows)), Target(nine.point("hand_l"), left), Target(nine.point("hand_r"), right)]
    pose = tasks.solve(start(len(rows)), [contacts, [Target(nine.point("pelvis"), pelvis)]], wanted)
    return Pose(pose.pelvis[which], pose.rotations[which])


def _hands(places: Array, time: Array, move: float, hold: float) -> list[Target]:
    """Both hands on their ways."""
    return [Target(nine.point(f"hand_{s}"), _along(places[:, i], time, move, hold)) for i, s in enumerate("lr")]


def _hand(way: Way, side: int) -> tuple[float, float, float]:
    """Where a hand is [m]: on its handle or about its shoulder."""
    where = way.left if side < 0 else way.right
    if isinstance(where, float):
        return side * HANDLE[0], HANDLE[1], where
    turn = Rotation.from_euler("xyz", way.trunk, degrees=True)
    shoulder = np.array(way.pelvis) + turn.apply(np.array(nine.SHOULDER) * [side, 1, 1])
    x, y, z = shoulder + np.array(where) * [side, 1, 1]
    return float(x), float(y), float(z)


def _along(points: Array, time: Array, move: float, hold: float) -> Array:
    """Points one after the other: a minimum-jerk move to each, then a hold; shape (n, 3)."""
    i = np.minimum((time // (move + hold)).astype(int), len(points) - 1)
    s = jerkless(np.clip((time - i * (move + hold)) / move, 0.0, 1.0))[:, None]
    before = points[np.maximum(i - 1, 0)]
    return np.asarray(before + s * (points[i] - before))


def _load(places: Array, held: Sequence[bool], time: Array, move: float, hold: float, *, still: bool = True) -> Array:
    """Load of a contact, 0 to 1: while it is held and, on the way, where both ends are the same (still) or both are held."""
    on = np.array(held)
    i = np.minimum((time // (move + hold)).astype(int), len(places) - 1)
    before = np.maximum(i - 1, 0)
    moving = time - i * (move + hold) < move
    same = on[before] & (np.all(places[i] == places[before], axis=1) | (not still))
    touched = on[i] & (~moving | same)
    steps = int(RAMP * (1.0 / (time[1] - time[0]))) or 1
    # a contact takes its load within RAMP and has lost it when it ends
    far = np.minimum(_since(~touched), _since(~touched[::-1])[::-1])
    return jerkless(np.clip(far / steps, 0.0, 1.0))


def _since(event: Array | np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Array:
    """Samples since the last event, counted from far before the first sample."""
    count = np.arange(len(event))
    last = np.maximum.accumulate(np.where(event, count, -len(event)))
    return np.asarray(count - last, dtype=float)
