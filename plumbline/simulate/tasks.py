r"""Prioritised inverse kinematics of the nine-segment body: contacts before CoM before posture.

Source: Gonzalez et al. (2013), eqs. (1)-(5): a task i asks for :math:`J_i\,\delta q = e_i`; the stack is solved by projection into the
null space of all tasks before it,

.. math:: \delta q_i = \delta q_{i-1} + (J_i N_{i-1})^{+}(e_i - J_i\,\delta q_{i-1}), \qquad
          N_i = N_{i-1}\bigl(1 - (J_i N_{i-1})^{+} J_i N_{i-1}\bigr),

with damped inverses. Here the step is repeated until nothing moves, at all instants side by side: the pose is then a function of the
targets of its instant alone, as smooth as they are.

q: pelvis [m] and the turn of each segment [rad], both in world axes, (3 + 9 x 3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from plumbline.simulate.nine_segments import INDEX, PARENTS, Array, place

DAMPING = 1e-10  # [m2 or rad2] of the inverses: contacts stay put to 1e-8 m
LARGEST = 0.25  # [rad or m] step of any coordinate
STILL = 1e-8  # [rad or m] step that ends the iteration
GAIN = 0.4  # [1] of the way to the posture in a step: a whole step swings about it where arms or legs are nearly straight
#: rigidity of posture at each segment's joint about its own x (flexion), y, z: knees and elbows would rather bend than turn
STIFF = np.array([[1.5] * 3, *[[0.7] * 3] * 2, *[[0.5, 1.5, 1.5]] * 2, *[[0.7, 1.0, 1.0]] * 2, *[[0.5, 2.0, 2.0]] * 2])


class Unreachable(ValueError):
    """The targets of a motion cannot be met."""


class Task(NamedTuple):
    """jacobian, shape (n, r, 30).  error: what is missing to the target, shape (n, r)."""

    jacobian: Array
    error: Array


@dataclass(frozen=True)
class Pose:
    """pelvis [m], shape (n, 3).  rotations: segment to world, shape (n, 9, 3, 3)."""

    pelvis: Array
    rotations: Array


@dataclass(frozen=True)
class Target:
    """A point that shall be somewhere.

    arms: vectors r_k of the point, shape (9, 3).  position [m], shape (n, 3).  axes: which of x, y, z count.
    """

    arms: Array
    position: Array
    axes: tuple[int, ...] = (0, 1, 2)


def prioritised(tasks: Sequence[Task], damping: float = DAMPING) -> Array:
    """One step of the stack, eqs. (1)-(5), shape (n, 30)."""
    n, _, d = tasks[0].jacobian.shape
    step, null = np.zeros((n, d)), np.broadcast_to(np.eye(d), (n, d, d))
    for jacobian, error in tasks:
        inside = jacobian @ null
        missing = error - np.einsum("nrd,nd->nr", jacobian, step)
        turned = inside.transpose(0, 2, 1)
        small = inside.shape[1] < d // 2
        if small:
            inverse = np.linalg.solve(inside @ turned + damping * np.eye(inside.shape[1]), inside).transpose(0, 2, 1)
        else:  # posture: more rows than freedoms are left
            inverse = np.linalg.solve(turned @ inside + 1e3 * damping * np.eye(d), turned)
        step = step + np.einsum("nij,njr,nr->ni", null, inverse, missing)
        if small:
            null = null - inverse @ inside
    return step


def _reach(pose: Pose, targets: Sequence[Target]) -> Task:
    """The task of points that shall be somewhere: d point = d pelvis + sum w_k x (A_k r_k)."""
    jacobians, errors = [], []
    for target in targets:
        lever = np.einsum("nkij,kj->nki", pose.rotations, target.arms)
        jacobian = np.zeros((len(lever), 3, 30))
        jacobian[:, :, :3] = np.eye(3)
        for k in range(9):
            jacobian[:, :, 3 + 3 * k : 6 + 3 * k] = -_cross(lever[:, k])
        rows = list(target.axes)
        jacobians.append(jacobian[:, rows])
        errors.append((target.position - place(pose.pelvis, pose.rotations, target.arms))[:, rows])
    return Task(np.concatenate(jacobians, axis=1), np.concatenate(errors, axis=1))


def _cross(v: Array) -> Array:
    """Matrices of v x ..., shape (n, 3, 3)."""
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.stack([np.stack([o, -z, y], 1), np.stack([z, o, -x], 1), np.stack([-y, x, o], 1)], 1)


def _posture(pose: Pose, wanted: Array) -> Task:
    """The task of joints that shall be turned as in a posture.  wanted: child to parent, shape (n, 9, 3, 3)."""
    n = len(wanted)
    jacobian, error = np.zeros((n, 27, 30)), np.zeros((n, 27))
    for k, parent in enumerate(PARENTS):
        above = np.broadcast_to(np.eye(3), (n, 3, 3)) if parent < 0 else pose.rotations[:, parent]
        here = above @ wanted[:, k]
        own = here.transpose(0, 2, 1) * STIFF[k][:, None]  # weighted, in the axes of the posture
        rows = slice(3 * k, 3 * k + 3)
        turn = Rotation.from_matrix(here @ pose.rotations[:, k].transpose(0, 2, 1)).as_rotvec()
        error[:, rows] = GAIN * np.einsum("nij,nj->ni", own, turn)
        jacobian[:, rows, 3 + 3 * k : 6 + 3 * k] = own
        if parent >= 0:
            jacobian[:, rows, 3 + 3 * parent : 6 + 3 * parent] = -own
    return Task(jacobian, error)


def _moved(pose: Pose, step: Array) -> Pose:
    """The pose after a step, shape (n, 30)."""
    n = len(step)
    turns = Rotation.from_rotvec(step[:, 3:].reshape(-1, 3)).as_matrix().reshape(n, 9, 3, 3)
    return Pose(pose.pelvis + step[:, :3], turns @ pose.rotations)


def solve(start: Pose, levels: Sequence[Sequence[Target]], posture: Array, *, iterations: int = 300) -> Pose:
    """The pose that meets the targets level by level and else keeps the posture.

    start: first guess, n instants.  posture: turn of each segment against its parent, shape (n, 9, 3, 3) or (9, 3, 3).
    Raises Unreachable where the first level is missed by more than 1 um or the pose has not settled.
    """
    wanted = np.broadcast_to(posture, start.rotations.shape)
    pelvis, rotations = start.pelvis.copy(), start.rotations.copy()
    left, size = np.arange(len(pelvis)), np.full(len(pelvis), np.inf)
    for _ in range(iterations):  # instants that have settled are left alone
        here = Pose(pelvis[left], rotations[left])
        step = prioritised([*(_reach(here, _at(targets, left)) for targets in levels), _posture(here, wanted[left])])
        size[left] = np.abs(step).max(axis=1)
        here = _moved(here, step * np.minimum(1.0, LARGEST / np.maximum(size[left], STILL))[:, None])
        pelvis[left], rotations[left] = here.pelvis, here.rotations
        left = left[size[left] > STILL]
        if not len(left):
            break
    pose = Pose(pelvis, rotations)
    missed = float(np.abs(_reach(pose, levels[0]).error).max())
    if size.max() > 1e-5 or missed > 1e-6:
        raise Unreachable(f"contacts are missed by {missed:.2g} m, the last step was {size.max():.2g}")
    return pose


def _at(targets: Sequence[Target], which: NDArray[np.intp]) -> list[Target]:
    """The same targets at some of their instants."""
    return [replace(target, position=target.position[which]) for target in targets]


def polish(pose: Pose, targets: Sequence[Target]) -> Pose:
    """The nearest pose whose contacts are exact: two steps of the first level alone."""
    for _ in range(2):
        pose = _moved(pose, prioritised([_reach(pose, targets)]))
    return pose


def interpolated(pose: Pose, knots: Array, time: Array) -> Pose:
    """A pose known at knots [s], at other times [s]: cubic splines of pelvis and quaternions."""
    quaternions = Rotation.from_matrix(pose.rotations.reshape(-1, 3, 3)).as_quat().reshape(len(knots), 9, 4)
    turned = np.sign(np.sum(quaternions[1:] * quaternions[:-1], axis=2))
    quaternions[1:] *= np.cumprod(turned, axis=0)[:, :, None]
    fine = CubicSpline(knots, quaternions)(time)
    rotations = Rotation.from_quat(fine.reshape(-1, 4)).as_matrix().reshape(len(time), 9, 3, 3)
    return Pose(CubicSpline(knots, pose.pelvis)(time), rotations)


def against_parents(rotations: Array) -> Array:
    """Turn of each segment against its parent, shape (n, 9, 3, 3)."""
    above = [np.broadcast_to(np.eye(3), rotations[:, 0].shape) if k < 0 else rotations[:, k].transpose(0, 2, 1) for k in PARENTS]
    return np.stack([above[k] @ rotations[:, k] for k in range(9)], axis=1)


def posed(angles: Mapping[str, Sequence[float]]) -> Array:
    """A posture from joint angles: turn of each segment against its parent, shape (9, 3, 3).

    angles: segment -> degrees about its x, y, z (in this order, each about the parent's axes); missing: 0. About x: positive lifts a limb
    forward (hips, shoulders, elbows), knees bend by negative values, and the trunk leans back.
    """
    turns = np.tile(np.eye(3), (9, 1, 1))
    for name, degrees in angles.items():
        turns[INDEX[name]] = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    return turns


def composed(posture: Array) -> Array:
    """World rotations of a posture, shape (9, 3, 3)."""
    world: list[Array] = []
    for k, parent in enumerate(PARENTS):
        world.append(posture[k] if parent < 0 else world[parent] @ posture[k])
    return np.stack(world)
