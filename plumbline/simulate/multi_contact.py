"""Recordings of a nine-segment person who touches floor, handles and a seat, with the true CoM.

Source: Gonzalez et al. (2013): calibration on slow sines of the CoM with feet and hands fixed, then the same volume faster, then
standing up. Poses are worked out once, for the body of the table: people differ in masses only, so that one motion serves them all and
each has their own true CoM over it. The CoM target is met by the CoM of the table.

Axes of the person: x right, y forward, z up. The paper's x is taken as forward, so that its amplitudes of 100/140/100 mm and periods of
200/321/347 s are those of y, x, z here. Poses are quasi-static; the acceleration of the CoM enters the forces of standing up alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from plumbline.physics import G
from plumbline.simulate import nine_segments as nine
from plumbline.simulate import tasks, wrenches
from plumbline.simulate.nine_segments import Array, Body
from plumbline.simulate.tasks import Pose, Target

STANCE, FOOT_MIDDLE = 0.15, 0.06  # [m] of the ankles from the middle; of a foot's middle ahead of its ankle
HANDLE = (0.22, 0.35)  # [m] to the side and forward
HEIGHTS = (0.80, 1.00, 1.20)  # [m] of the handles; the middle one in the paper's protocol
STAND, SEAT = (0.0, -0.02, 0.85), (0.0, -0.26, 0.53)  # [m] pelvis on bent knees and on the seat
CUSHION = 0.08  # [m] from the seat up to the pelvis
AMPLITUDE = np.array([0.070, 0.050, 0.050])  # [m] of right, forward, up: half of 140, 100, 100 mm
PERIODS = (321.0, 200.0, 347.0)  # [s] of the same
FAST = (17.0, 11.0, 23.0)  # [s] the same volume within a minute
RISE = 0.35  # [1] of the time of standing up in which the trunk leans before the pelvis leaves the seat
WHITE, COLOURED, MEMORY = 0.003, 0.002, 2.0  # [m], [m], [s] noise of the ground projection per axis

#: knees and elbows bent, hands ahead
READY = {
    **{f"thigh_{s}": (28.0, 0.0, 0.0) for s in "lr"},
    **{f"shank_{s}": (-52.0, 0.0, 0.0) for s in "lr"},
    **{f"upper_arm_{s}": (5.0, 0.0, 0.0) for s in "lr"},
    **{f"forearm_{s}": (65.0, 0.0, 0.0) for s in "lr"},
}


@dataclass(frozen=True)
class Motion:
    """How somebody moves, whoever it is.

    time [s], shape (n,).  pose: pelvis and segments.  feet: turn of the feet, shape (n, 2, 3, 3), None while they are flat.
    plates, grips: contacts.  dynamic: whether the acceleration of the CoM is felt.
    """

    time: Array
    pose: Pose
    plates: tuple[wrenches.Plate, ...]
    grips: tuple[wrenches.Grip, ...] = ()
    feet: Array | None = None
    dynamic: bool = False

    @cached_property
    def joints(self) -> dict[str, Array]:
        """Every joint [m], each of shape (n, 3)."""
        return nine.joints(self.pose.pelvis, self.pose.rotations)


@dataclass(frozen=True)
class Recording:
    """A motion of one person with the truth and what was measured.

    com: true [m], shape (n, 3).  acceleration: of the CoM as felt by the forces [m/s2], shape (n, 3).
    ground: measured projection (x, y) with noise and the person's bias [m], shape (n, 2).
    """

    motion: Motion
    body: Body
    com: Array
    acceleration: Array
    ground: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Segments in the order of `rotations`."""
        return nine.SEGMENTS

    @property
    def time(self) -> Array:
        """[s], shape (n,)."""
        return self.motion.time

    @property
    def rotations(self) -> Array:
        """True turn of each segment to the world, shape (n, 9, 3, 3)."""
        return self.motion.pose.rotations

    @property
    def joints(self) -> dict[str, Array]:
        """Every joint [m], each of shape (n, 3); "pelvis" is the origin of the chain."""
        return self.motion.joints

    @cached_property
    def contacts(self) -> list[wrenches.Contact]:
        """Every reaction on the person, without noise."""
        return wrenches.contacts(self.time, self.com, self.acceleration, self.body.mass, self.motion.plates, self.motion.grips)


def record(motion: Motion, body: Body, seed: int = 0, *, white: float = WHITE, coloured: float = COLOURED) -> Recording:
    """A person doing a motion.

    white, coloured: sd of the noise of the ground projection per axis [m], the coloured one with a correlation time of 2 s.
    The projection is the one that the forces tell, eq. (12): the CoM in statics, x - z x'' / (g + z'') else.
    """
    com = body.com(motion.pose.pelvis, motion.pose.rotations, motion.feet)
    acceleration = make_interp_spline(motion.time, com, k=5).derivative(2)(motion.time) if motion.dynamic else np.zeros_like(com)
    ground = com[:, :2] - com[:, 2:] * acceleration[:, :2] / (G + acceleration[:, 2:])
    noise = ground_noise(motion.time, seed, white=white, coloured=coloured)
    return Recording(motion, body, com, acceleration, ground + body.bias + noise)


def ground_noise(time: Array, seed: int, *, white: float = WHITE, coloured: float = COLOURED) -> Array:
    """White noise plus an Ornstein-Uhlenbeck process of 2 s [m], shape (n, 2)."""
    rng = np.random.default_rng([seed, 11])
    keep = np.exp(-(time[1] - time[0]) / MEMORY)
    drive = rng.normal(0.0, coloured * np.sqrt(1 - keep**2), (len(time), 2))
    drive[0] = rng.normal(0.0, coloured, 2)
    return np.asarray(lfilter([1.0], [1.0, -keep], drive, axis=0)) + rng.normal(0.0, white, (len(time), 2))


def misaligned(rotations: Array, seed: int, *, degrees: float = 1.5) -> Array:
    """Measured orientations A M with one constant M per segment: a random axis, an angle of sd `degrees`."""
    rng = np.random.default_rng([seed, 12])
    axis = rng.normal(size=(9, 3))
    turn = np.radians(degrees) * rng.normal(size=(9, 1)) * axis / np.linalg.norm(axis, axis=1, keepdims=True)
    return np.asarray(rotations @ Rotation.from_rotvec(turn).as_matrix())


def shaken(rotations: Array, seed: int, *, degrees: float = 0.4, memory: float = 0.0, rate: float = 100.0) -> Array:
    """Measured orientations with noise of sd `degrees` about each axis: white, or with a correlation time `memory` [s] at a rate [Hz]."""
    rng = np.random.default_rng([seed, 13])
    noise = rng.normal(0.0, np.radians(degrees), (len(rotations), 9, 3))
    if memory > 0:
        keep = np.exp(-1.0 / (rate * memory))
        noise[1:] *= np.sqrt(1 - keep**2)
        noise = np.asarray(lfilter([1.0], [1.0, -keep], noise, axis=0))
    return np.asarray(Rotation.from_rotvec(noise.reshape(-1, 3)).as_matrix().reshape(-1, 9, 3, 3) @ rotations)


def paper(duration: float = 300.0, rate: float = 100.0) -> Motion:
    """Calibration of the paper: feet and hands fixed, CoM on slow sines."""
    return _sines(duration, rate, PERIODS)


def volume(duration: float = 60.0, rate: float = 100.0) -> Motion:
    """The same volume with other, faster sines."""
    return _sines(duration, rate, FAST)


def sit_to_stand(duration: float = 2.0, rate: float = 100.0, *, handles: bool = True) -> Motion:
    """Standing up along a minimum-jerk path of the pelvis, hands on the handles or free, trunk leaning on the way; forces with inertia."""
    time = times(duration, rate)
    t = time / duration
    s = jerkless(np.clip((t - RISE) / (1 - RISE), 0.0, 1.0))
    pelvis = np.array(SEAT) + s[:, None] * (np.array(STAND) - SEAT)
    bow = jerkless(np.clip(t / (RISE + 0.1), 0.0, 1.0))  # over the feet before the seat is left
    lean = -(20.0 + 25.0 * bow) * (1 - jerkless(np.clip((t - RISE - 0.1) / (0.9 - RISE), 0.0, 1.0)))
    trunk = Rotation.from_euler("x", lean[:, None], degrees=True).as_matrix()
    free = {f"upper_arm_{s}": (50.0, 0.0, 0.0) for s in "lr"}
    wanted = np.tile(tasks.posed(READY if handles else READY | free), (len(time), 1, 1, 1))
    wanted[:, 0] = trunk
    hands = on_handles(len(time), HEIGHTS[1]) if handles else []
    pose = tasks.solve(start(len(time)), [ankles(len(time)) + hands, [Target(nine.point("pelvis"), pelvis)]], wanted)
    share = (1 - jerkless(np.clip((t - RISE) / 0.15, 0.0, 1.0))) ** 2
    plates = (*soles(len(time)), seat(len(time), share))
    return Motion(time, pose, plates, grips(hands, [np.ones(len(time))] * len(hands)), dynamic=True)


def _sines(duration: float, rate: float, periods: Sequence[float]) -> Motion:
    """Feet and hands fixed, CoM on sines about where it is in the middle pose."""
    time = times(duration, rate)
    knots = np.linspace(0.0, time[-1], max(int(np.ceil(60 * duration / min(periods))), 60))
    middle = tasks.solve(start(1), [_contacts(1), [Target(nine.point("pelvis"), np.array([STAND]))]], tasks.posed(READY))
    centre = nine.place(middle.pelvis, middle.rotations, nine.table().arms())
    centre[0, :2] = 0.0, FOOT_MIDDLE
    wave = np.stack([np.sin(2 * np.pi * knots / period) for period in periods], axis=1)
    wanted = Target(nine.table().arms(), centre + AMPLITUDE * wave)
    pose = tasks.solve(start(len(knots)), [_contacts(len(knots)), [wanted]], tasks.against_parents(middle.rotations)[0])
    fixed = _contacts(len(time))
    pose = tasks.polish(tasks.interpolated(pose, knots, time), fixed)
    return Motion(time, pose, soles(len(time)), grips(fixed[2:], [np.ones(len(time))] * 2))


def times(duration: float, rate: float) -> Array:
    """Instants [s]."""
    return np.arange(round(duration * rate)) / rate


def jerkless(s: Array) -> Array:
    """The minimum-jerk way from 0 to 1."""
    return s**3 * (10 - 15 * s + 6 * s**2)


def start(n: int) -> Pose:
    """A first guess: the middle pose, n times."""
    return Pose(np.tile(STAND, (n, 1)), np.tile(tasks.composed(tasks.posed(READY)), (n, 1, 1, 1)))


def ankles(n: int) -> list[Target]:
    """Both ankles where they stand."""
    return [Target(nine.point(f"ankle_{s}"), np.tile([side * STANCE, 0.0, nine.ANKLE], (n, 1))) for s, side in (("l", -1), ("r", 1))]


def on_handles(n: int, height: float) -> list[Target]:
    """Both hands on handles of one height [m]."""
    return [Target(nine.point(f"hand_{s}"), np.tile([side * HANDLE[0], HANDLE[1], height], (n, 1))) for s, side in (("l", -1), ("r", 1))]


def _contacts(n: int) -> list[Target]:
    return ankles(n) + on_handles(n, HEIGHTS[1])


def soles(n: int) -> tuple[wrenches.Plate, wrenches.Plate]:
    """The floor under both feet."""
    one = np.ones(n)
    left, right = (
        wrenches.Plate(f"foot_{s}", np.tile([side * STANCE, FOOT_MIDDLE, 0.0], (n, 1)), one) for s, side in (("l", -1), ("r", 1))
    )
    return left, right


def seat(n: int, share: Array) -> wrenches.Plate:
    """The seat, taking a share of the load, shape (n,)."""
    return wrenches.Plate("seat", np.tile([SEAT[0], SEAT[1] + 0.05, SEAT[2] - CUSHION], (n, 1)), share)


def grips(hands: Sequence[Target], loads: Sequence[Array]) -> tuple[wrenches.Grip, ...]:
    """Hands on what they hold."""
    return tuple(wrenches.Grip(f"hand_{s}", hand.position, load) for s, hand, load in zip("lr", hands, loads, strict=False))
