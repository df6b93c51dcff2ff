r"""Newton-Euler mechanics of a standing body of fourteen segments, for many trials at once.

The feet stay; the hips' middle moves with the lateral and forward coordinates q = (x, y) at a height the knees decide; each
leg is a thigh and a shank that close the triangle hip, knee, ankle with the knee forward; hips stay level; the upper body rolls
about the hips' middle. So every segment's CoM r and direction u is a combination, with constant factors, of four moving vectors:
the hips' middle, the first moment of the upper body about it, the right and the left knee from its ankle. The sums

.. math:: F = \sum m_i (\ddot r_i - g),\qquad M = \sum m_i\, r_i \times (\ddot r_i - g) + m_i k_i^2\, u_i \times \ddot u_i

over the segments become sums over those four. Own derivation; nothing here knows of a pendulum.
Arrays end in (3 components right, forward, up; 4 vectors; n times; t trials), scalars in (n, t).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from plumbline.physics import G
from plumbline.simulate.jets import Array, Jet
from plumbline.simulate.person import Subject
from plumbline.simulate.posture import Habits, Posture

HIPS, UPPER, KNEES = 0, 1, slice(2, 4)  # places of the four vectors; knees are right, left


class Level(NamedTuple):
    """One derivative of the placement: 0 places, 1 rates, 2 changes.

    vectors: the four moving vectors [m; the second kg m], shape (..., 3, 4, n, t).
    spin: sum of m c x (this derivative of c) over the upper body [kg m2 ...], (..., 3, n, t); unused at level 0.
    """

    vectors: Array
    spin: Array


@dataclass(frozen=True)
class Body:
    """Constants of t people: lengths [m] and masses [kg], shape (t,); side-by-side ones (2, 1, t) with right first.

    aside: hip minus ankle, lateral.  first: factors of the four vectors in the first moment [kg], (4, 1, t); first_rest: what
    stays in it [kg m], (3, 1, t).  second: their factors in the second moment [kg], (4, 4, t), and second_rest (3, 4, 1, t).
    push: height of the pushing hand above the hips along the trunk.  curve, follow: see `Habits`.
    """

    mass: Array
    leg: Array
    thigh: Array
    shank: Array
    aside: Array
    ankle: Array
    first: Array
    first_rest: Array
    second: Array
    second_rest: Array
    push: Array
    curve: float
    follow: Array | float


def body(subjects: Sequence[Subject], habits: Habits) -> Body:
    """The constants of t people who stand with these habits."""
    side = np.array([1.0, -1.0])[:, None, None]
    hip, stance, ankle, mass = (_each(subjects, n) for n in ("hip", "stance", "ankle", "mass"))
    aside = side * (hip - stance)
    first, rest, second, second_rest = _sums(subjects, aside, side * stance, ankle)
    return Body(
        mass=mass,
        leg=_each(subjects, "leg"),
        thigh=_length(subjects, "thigh"),
        shank=_length(subjects, "shank"),
        aside=aside,
        ankle=ankle,
        first=first,
        first_rest=rest,
        second=second,
        second_rest=second_rest,
        push=_each(subjects, "push") * _length(subjects, "trunk"),
        curve=habits.curve,
        follow=habits.follow,
    )


def _each(subjects: Sequence[Subject], name: str) -> Array:
    return np.array([getattr(s, name) for s in subjects])


def _length(subjects: Sequence[Subject], segment: str) -> Array:
    return np.array([s.lengths[segment] for s in subjects])


def _sums(subjects: Sequence[Subject], aside: Array, stance: Array, ankle: Array) -> tuple[Array, Array, Array, Array]:
    """first, first_rest, second and second_rest of `Body`.

    With hip d and knee k from the ankle A: shank CoM A + l k, thigh CoM A + (1 - c) d + c k, directions k and d - k, where c is
    the thigh's CoM from the hip and l the shank's from the ankle; d = hips + (aside, 0, 0) - (0, 0, ankle).
    """
    inertia = {n: np.array([s.segments[n] for s in subjects]).T for n in ("thigh", "shank", "foot")}
    mass = _each(subjects, "mass")
    (m, c, g), (ms, cs, gs), (mf, cf, _) = inertia["thigh"], inertia["shank"], inertia["foot"]
    m, ms, mf, low = m * mass, ms * mass, mf * mass, 1 - cs
    d1, k1 = m * (1 - c), ms * low + m * c
    dd, dk = m * ((1 - c) ** 2 + g**2), m * (c * (1 - c) - g**2)
    kk = ms * (low**2 + gs**2) + m * (c**2 + g**2)
    one, none, upper = np.ones_like(m), np.zeros_like(m), mass - 2 * (m + ms + mf)
    first = np.stack([upper + 2 * d1, one, k1, k1])[:, None]
    foot_y = cf * _length(subjects, "foot") - _each(subjects, "heel")
    rest_z = 2 * (mf * _each(subjects, "foot_height") + (m + ms - d1) * ankle)
    rest = np.stack([none, 2 * mf * foot_y, rest_z])[:, None]
    rows = [[upper + 2 * dd, one, dk, dk], [one, none, none, none], [dk, none, kk, none], [dk, none, none, kk]]
    second_rest = np.zeros((3, 4, 1, len(mass)))
    second_rest[0, KNEES] = dk * aside + k1 * stance
    second_rest[2, KNEES] = (k1 - dk) * ankle
    second_rest[2, HIPS] = 2 * (d1 - dd) * ankle
    return first, rest, np.array(rows), second_rest


def place(b: Body, posture: Posture, x: Jet, y: Jet) -> tuple[Level, Level, Level]:
    """Placement of the body, its rates and changes, from the lateral and forward coordinates of the hips' middle.

    The changes of x and y may have a leading axis of alternatives; then those of the result have it too.
    """
    lead, size = x.change.shape[:-2], np.broadcast_shapes(x.value.shape[-2:], posture.roll[0].shape)
    vectors = [np.empty((*(lead if k == 2 else ()), 3, 4, *size)) for k in range(3)]
    for axis, jet in enumerate((x, y, _height(b, posture, x, y))):
        for v, values in zip(vectors, jet, strict=True):
            v[..., axis, HIPS, :, :] = values
    leg = vectors[0][:, HIPS, None].repeat(2, axis=1)
    leg[0] += b.aside
    leg[2] -= b.ankle
    _knees(b, leg, vectors)
    spins = _upper(posture, roll(b, posture, x), vectors)
    return Level(vectors[0], vectors[0][:, 0]), Level(vectors[1], spins[0]), Level(vectors[2], spins[1])


def _height(b: Body, posture: Posture, x: Jet, y: Jet) -> Jet:
    """Height of the hips: on the sphere that the standing leg length spans, less what the knees give way [m]."""
    s = np.sqrt(b.leg**2 - x.value**2 - y.value**2)
    s1 = (x.value * x.rate + y.value * y.rate) / -s
    s2 = (x.rate**2 + y.rate**2 + s1**2 + x.value * x.change + y.value * y.change) / -s
    sink, c = posture.sink, 2 * b.curve
    down = b.ankle + s - sink[0], s1 - sink[1], s2 - sink[2]
    if c == 0.0:
        return Jet(*down)
    bend = x.value**2 / 2, x.value * x.rate, x.rate**2 + x.value * x.change
    return Jet(down[0] - c * bend[0], down[1] - c * bend[1], down[2] - c * bend[2])


def _knees(b: Body, d: Array, vectors: list[Array]) -> None:
    r"""Fill in the knees from their ankles, :math:`\kappa = A d + g\, e_y`, d the hip from the ankle (3, 2, n, t).

    With shank s, thigh t, :math:`\rho = |d|^2` and :math:`K = s^2 - t^2`, the triangle :math:`|\kappa| = s`,
    :math:`|d - \kappa| = t` gives :math:`g^2 = (s^2\rho - (\rho + K)^2/4)/(\rho - d_y^2)` and
    :math:`A = 1/2 + (K/2 - g\,d_y)/\rho`; g > 0 puts the knee forward.
    """
    d1, d2 = vectors[1][:, HIPS, None], vectors[2][..., HIPS, None, :, :]
    y, y1, y2 = d[1], d1[1], d2[..., 1, :, :, :]
    s, k = b.shank**2, b.shank**2 - b.thigh**2
    rho = (d * d).sum(axis=0)
    rho1 = 2 * (d * d1).sum(axis=0)
    rho2 = 2 * ((d1 * d1).sum(axis=0) + (d * d2).sum(axis=-4))
    bottom = rho - y * y
    slope = s - (rho + k) / 2  # of the numerator of g^2 with respect to rho
    square = (s * rho - (rho + k) ** 2 / 4) / bottom
    bottom1 = rho1 - 2 * y * y1
    square1 = (slope * rho1 - square * bottom1) / bottom
    bottom2 = rho2 - 2 * (y1 * y1 + y * y2)
    square2 = (slope * rho2 - rho1**2 / 2 - 2 * square1 * bottom1 - square * bottom2) / bottom
    g = np.sqrt(square)
    g1 = square1 / (2 * g)
    g2 = (square2 / 2 - g1 * g1) / g
    a = (k / 2 - g * y) / rho
    a1 = (g1 * y + g * y1 + a * rho1) / -rho
    a2 = (g2 * y + 2 * g1 * y1 + g * y2 + 2 * a1 * rho1 + a * rho2) / -rho
    a = a + 0.5
    for level, along in enumerate((a * d, a1 * d + a * d1, a2[..., None, :, :, :] * d + 2 * a1 * d1 + a * d2)):
        along[..., 1, :, :, :] += (g, g1, g2)[level]
        vectors[level][..., KNEES, :, :] = along


def roll(b: Body, posture: Posture, x: Jet) -> Jet:
    """Roll of the trunk to the right [rad]."""
    own = Jet(posture.roll[0], posture.roll[1], posture.roll[2])
    return own if not np.any(b.follow) else own.plus(x.scaled(b.follow))


def _upper(posture: Posture, angle: Jet, vectors: list[Array]) -> tuple[Array, Array]:
    """Fill in the upper body's first moment about the hips; its own moments of rates and changes are returned."""
    w, dw = angle.rate, angle.change[..., None, None, :, :]
    rate = posture.rate + w * posture.turn
    change = posture.change + 2 * w * posture.twist + w * w * posture.fling + dw * posture.turn
    cos, sin = np.cos(angle.value), np.sin(angle.value)
    pairs = [turned(v, cos, sin) for v in (posture.still, rate, change)]
    for v, pair in zip(vectors, pairs, strict=True):
        v[..., UPPER, :, :] = pair[..., 0, :, :, :]
    return pairs[1][..., 1, :, :, :], pairs[2][..., 1, :, :, :]


def turned(v: Array, cos: Array, sin: Array) -> Array:
    """Vectors (..., 3, n, t) turned about the forward axis, +z towards +x."""
    out = np.empty(np.broadcast_shapes(v.shape, cos.shape))
    x, z = v[..., 0, :, :], v[..., 2, :, :]
    out[..., 0, :, :] = cos * x + sin * z
    out[..., 1, :, :] = v[..., 1, :, :]
    out[..., 2, :, :] = cos * z - sin * x
    return out


def first_moment(b: Body, level: Level) -> Array:
    """Sum of m r' or m r'' over all segments [kg m/s ...], (..., 3, n, t); of places without `Body.first_rest`."""
    return np.asarray((b.first * level.vectors).sum(axis=-3))


def com(b: Body, places: Level) -> Array:
    """Whole-body CoM [m], (3, n, t)."""
    return (first_moment(b, places) + b.first_rest) / b.mass


def moment(b: Body, places: Level, other: Level) -> Array:
    """Sum of m r x r' (angular momentum) or m r x r'' over all segments with their own spin, about the origin, (..., 3, n, t)."""
    u = np.einsum("abt,cbnt->cant", b.second, places.vectors) + b.second_rest
    v = other.vectors
    out = np.array(np.broadcast_to(other.spin, v.shape[:-3] + v.shape[-2:]))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i, :, :] += (u[j] * v[..., k, :, :, :] - u[k] * v[..., j, :, :, :]).sum(axis=-3)
    return out


def wrench(b: Body, levels: tuple[Level, Level, Level], centre: Array) -> tuple[Array, Array]:
    """Force [N] and moment about the origin [N m] that the surroundings must give, gravity taken out, (..., 3, n, t).

    centre: CoM [m], (3, n, t), where gravity acts.
    """
    force, turn = first_moment(b, levels[2]), moment(b, levels[0], levels[2])
    force[..., 2, :, :] += b.mass * G
    turn[..., 0, :, :] += b.mass * G * centre[1]
    turn[..., 1, :, :] -= b.mass * G * centre[0]
    return force, turn
