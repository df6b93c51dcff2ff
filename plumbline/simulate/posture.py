"""What a simulated person does of their own accord: prescribed motions of trunk, arms and knees, as functions of time.

Everything above the hips turns with the trunk's roll, which may also follow the state; pitch and arms are functions of time
alone, so that all they do to the balance of forces is worked out beforehand, here.

Arrays end in (n times, t trials); vectors have three components (right, forward, up) before that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from plumbline.simulate.jets import Array, Jet, constant
from plumbline.simulate.person import ENDS, Subject

JetVec = tuple[Jet, Jet, Jet]
UPPER = ("trunk", "head", "upper_arm", "forearm", "hand")
ELBOW = 0.15  # [rad] forward bend of the forearm


class Wave(NamedTuple):
    """A sine of time, amplitude [rad or m], frequency [Hz], phase [rad]; phase may differ between trials, shape (t,)."""

    amplitude: float
    frequency: float
    phase: Array | float = 0.0

    def at(self, time: Array) -> Jet:
        """Value and derivatives at times [s], shape (n, 1) or (n, t)."""
        w = 2 * np.pi * self.frequency
        s = np.sin(w * time + self.phase) * self.amplitude
        return Jet(s, np.cos(w * time + self.phase) * self.amplitude * w, -(w**2) * s)


@dataclass
class Habits:
    """Prescribed motions, sums of waves; empty = still.

    roll: trunk towards the right [rad].  pitch: trunk forward [rad].  swing: arms, right forward as left goes back [rad].
    sink: pelvis down by knee bending [m], each wave counted from its lowest value, so that it never lengthens the legs.
    curve: pelvis down by `curve` times the square of its distance from the middle [1/m].
    follow: trunk roll per lateral displacement of the pelvis [rad/m]; 0 keeps the trunk upright while the legs lean; may differ between
    trials, shape (t,).
    """

    roll: tuple[Wave, ...] = ()
    pitch: tuple[Wave, ...] = ()
    swing: tuple[Wave, ...] = ()
    sink: tuple[Wave, ...] = ()
    curve: float = 0.0
    follow: Array | float = 0.0


class Posture(NamedTuple):
    """The prescribed motions at n times.

    roll, pitch [rad], sink [m]: value, rate, change, each (n, t).  The others describe the upper body, turned by pitch but not by
    roll, in pairs (2, 3, n, t): first moment about the hips' middle [kg m ...], and sum of m c x that same quantity's vector c.
    still: the pair of c itself (its second half is 0).  rate, change: of c', c''.  turn, twist, fling: of e x c, e x c' and
    e x (e x c), e the axis of the roll.
    """

    roll: Array
    pitch: Array
    sink: Array
    still: Array
    rate: Array
    change: Array
    turn: Array
    twist: Array
    fling: Array


def unpack(table: Array) -> Posture:
    """The rows of a table of `pack` by name."""
    pairs = table[9:].reshape(6, 2, 3, *table.shape[1:])
    return Posture(table[0:3], table[3:6], table[6:9], *pairs)


def pack(subjects: Sequence[Subject], habits: Habits, time: Array) -> Array:
    """The motions of t subjects at times of shape (n, 1) as one table for `unpack`, shape (45, n, t)."""
    size = (len(time), len(subjects))
    pairs = _pairs(_parts(subjects, upper_joints(subjects, habits, time)))
    angles = [*total(habits.roll, time), *total(habits.pitch, time)]
    rows = [*angles, *_sink(habits, time), *pairs.reshape(-1, *pairs.shape[-2:])]
    return np.stack([np.broadcast_to(r, size) for r in rows])


def total(waves: tuple[Wave, ...], time: Array) -> Jet:
    """Sum of waves at times [s]; a constant of shape (1, 1) where there are none, which keeps still bodies cheap."""
    out = constant(np.zeros((1, 1)))
    for wave in waves:
        out = out.plus(wave.at(time))
    return out


def _sink(habits: Habits, time: Array) -> Jet:
    """How far the pelvis is below its standing height [m], never negative."""
    down = total(habits.sink, time)
    return down.plus(constant(sum(abs(w.amplitude) for w in habits.sink)))


def upper_joints(subjects: Sequence[Subject], habits: Habits, time: Array) -> dict[str, JetVec]:
    """Places of the upper body's joints from the hips' middle, trunk pitched but not rolled, by marker label [m]."""
    pitch, swing = total(habits.pitch, time), total(habits.swing, time)
    at_shoulder = np.array([s.shoulder_share * s.lengths["trunk"] for s in subjects])
    aside, spread = np.array([s.shoulder for s in subjects]), np.array([s.spread for s in subjects])
    up, forward = (constant(0.0), pitch.sin(), pitch.cos()), (constant(0.0), pitch.cos(), pitch.sin().scaled(-1.0))
    right: JetVec = (constant(1.0), constant(0.0), constant(0.0))
    c7 = _scale(up, _length(subjects, "trunk"))
    joints = {"PELV": _scale(up, 0.0), "C7": c7, "HEAD": _plus(c7, _scale(up, _length(subjects, "head")))}
    for side, sign in (("R", 1.0), ("L", -1.0)):
        at = _plus(_scale(up, at_shoulder), _scale(right, sign * aside))
        joints[f"{side}SHO"] = at
        for name, label, bent in (("upper_arm", "ELB", 0.0), ("forearm", "WRI", ELBOW), ("hand", "FIN", ELBOW)):
            angle = swing.scaled(sign).plus(constant(bent))
            hang = _plus(_turn(forward, angle.sin(), np.cos(spread)), _turn(up, angle.cos(), -np.cos(spread)))
            arm = _plus(_scale(right, sign * np.sin(spread)), hang)
            at = joints[f"{side}{label}"] = _plus(at, _scale(arm, _length(subjects, name)))
    return joints


def _length(subjects: Sequence[Subject], name: str) -> Array:
    return np.array([s.lengths[name] for s in subjects])


def _scale(v: JetVec, factor: Array | float) -> JetVec:
    return (v[0].scaled(factor), v[1].scaled(factor), v[2].scaled(factor))


def _plus(v: JetVec, w: JetVec) -> JetVec:
    return (v[0].plus(w[0]), v[1].plus(w[1]), v[2].plus(w[2]))


def _turn(v: JetVec, factor: Jet, scale: Array) -> JetVec:
    return (v[0].times(factor).scaled(scale), v[1].times(factor).scaled(scale), v[2].times(factor).scaled(scale))


def _parts(subjects: Sequence[Subject], joints: dict[str, JetVec]) -> list[tuple[Array, JetVec, bool]]:
    """Each upper segment as two vectors with its mass [kg]: its CoM, and its length times its gyration (counted as spread).

    A rod of mass m and radius k along u has the second moment m (c c^T + k^2 u u^T): that of these two vectors.
    """
    parts: list[tuple[Array, JetVec, bool]] = []
    for name in UPPER:
        mass = np.array([s.mass * s.segments[name].mass for s in subjects])
        com = np.array([s.segments[name].com for s in subjects])
        gyration = np.array([s.segments[name].gyration for s in subjects])
        for side in ("",) if name in ("trunk", "head") else ("R", "L"):
            near, far = joints[side + ENDS[name][0]], joints[side + ENDS[name][1]]
            along = _plus(far, _scale(near, -1.0))
            parts += [(mass, _plus(near, _scale(along, com)), True), (mass, _scale(along, gyration), False)]
    return parts


def _pairs(parts: list[tuple[Array, JetVec, bool]]) -> Array:
    """The pairs still, rate, change, turn, twist, fling of `Posture`, (6, 2, 3, n, t)."""
    moments: list[Array] = []
    spins: list[Array] = []
    for mass, jets, is_place in parts:
        c, c1, c2 = (_level(jets, level) for level in range(3))
        partners = np.stack(np.broadcast_arrays(c, c1, c2, rolled(c), rolled(c1), rolled(rolled(c))))
        spins.append(mass * np.cross(c[None], partners, axis=1))
        if is_place:
            moments.append(mass * partners)
    return np.stack([np.sum(moments, axis=0), np.sum(spins, axis=0)], axis=1)


def _level(c: JetVec, level: int) -> Array:
    """One derivative of a vector, (3, n, t)."""
    return np.stack(np.broadcast_arrays(*(np.atleast_2d(part[level]) for part in c)))


def rolled(v: Array) -> Array:
    """e x v for the axis e = y, which turns +z towards +x; v has its components third from the end, (..., 3, n, t)."""
    out = v[..., ::-1, :, :] * np.array([1.0, 0.0, -1.0])[:, None, None]
    return np.asarray(out)
