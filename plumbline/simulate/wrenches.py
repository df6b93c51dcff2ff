r"""What plates, handles and a seat measure: reactions on a person that balance the weight, and the ground projection they tell.

Statics: :math:`\sum f = m g\,n`, :math:`\sum (p - c) \times f + \tau = 0` about the CoM c; with the acceleration of the CoM
:math:`\sum f = m (g\,n + \ddot c)`, turning of the segments left out. Hands carry what they are told to; plates share the rest, with the
smallest forces and moments about their middles, and report it at their centre of pressure; hands on handles help a little, so that
the centre of pressure stays near the feet.

Source of the projection: Gonzalez et al. (2013), eq. (12), :math:`n \times M_o / (W \cdot n)` with the positive vertical load.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from plumbline.physics import G
from plumbline.simulate.nine_segments import Array
from plumbline.simulate.tasks import Unreachable

PLATE = 0.10  # [m] lever that weighs the moments of a plate against its forces
LOADED = 1.0  # [N] vertical force over which a plate has a centre of pressure
HAND = (0.005, 0.008, 0.030)  # [1] of the weight a hand carries: amplitude of right, forward; mean and amplitude of up
UP = np.array([0.0, 0.0, 1.0])
HELP = 0.10  # [1] readiness of a hand to take force, of a plate's
GRIP = 0.5  # [N m] free moment of a hand


@dataclass(frozen=True)
class Contact:
    """One measured wrench on the person.  point [m], force [N], moment: free, about the point [N m], each of shape (n, 3)."""

    name: str
    point: Array
    force: Array
    moment: Array


class Plate(NamedTuple):
    """A surface that can be stood or sat on.  point: its middle [m], shape (n, 3).  share: 0 out of contact to 1, shape (n,)."""

    name: str
    point: Array
    share: Array


class Grip(NamedTuple):
    """A hand on a handle.  point [m], shape (n, 3).  load: 0 out of contact to 1, shape (n,)."""

    name: str
    point: Array
    load: Array


def contacts(time: Array, com: Array, acceleration: Array, mass: float, plates: Sequence[Plate], grips: Sequence[Grip]) -> list[Contact]:
    """Every reaction on the person.

    time [s], shape (n,).  com [m], acceleration [m/s2], shape (n, 3); zero: statics.  mass [kg].
    Raises Unreachable where a plate would have to pull.
    """
    hands = [_hand(grip, i, time, mass) for i, grip in enumerate(grips)]
    force = mass * (acceleration + G * UP)
    moment = np.zeros_like(com)
    for hand in hands:
        force = force - hand.force
        moment = moment - np.cross(hand.point - com, hand.force) - hand.moment
    helping = [Plate(grip.name, grip.point, HELP * grip.load) for grip in grips]
    shared = _shared(com, force, moment, [*plates, *helping], [PLATE] * len(plates) + [0.0] * len(helping))
    feet = [_pressed(plate) for plate in shared[: len(plates)]]
    return feet + [replace(hand, force=hand.force + more.force) for hand, more in zip(hands, shared[len(plates) :], strict=True)]


def _hand(grip: Grip, i: int, time: Array, mass: float) -> Contact:
    """A hand that pulls, pushes and leans a little, slowly changing."""
    weight = mass * G * grip.load[:, None]
    wave = np.stack([np.sin(2 * np.pi * time / period + i) for period in (7.0, 11.0, 13.0)], axis=1)
    force = weight * HAND * (wave + UP)
    return Contact(grip.name, grip.point, force, GRIP * grip.load[:, None] * wave[:, ::-1])


def _shared(com: Array, force: Array, moment: Array, plates: Sequence[Plate], levers: Sequence[float]) -> list[Contact]:
    """A force and a moment about the CoM, shared: least squares in forces and in moments over a lever [m]; 0: no moments."""
    system = np.zeros((len(com), 6, 6))
    arms = [_cross(plate.point - com) for plate in plates]
    for plate, arm, lever in zip(plates, arms, levers, strict=True):
        back = arm.transpose(0, 2, 1)
        block = np.block([[np.broadcast_to(np.eye(3), arm.shape), back], [arm, arm @ back + lever**2 * np.eye(3)]])
        system += plate.share[:, None, None] * block
    weights = np.linalg.solve(system, np.concatenate([force, moment], axis=1)[:, :, None])[:, :, 0]
    out = []
    for plate, arm, lever in zip(plates, arms, levers, strict=True):
        share = plate.share[:, None]
        f = share * (weights[:, :3] + np.einsum("nji,nj->ni", arm, weights[:, 3:]))
        if lever and f[:, 2].min() < -LOADED:
            raise Unreachable(f"{plate.name} would have to pull by {-f[:, 2].min():.0f} N")
        out.append(Contact(plate.name, plate.point, f, share * lever**2 * weights[:, 3:]))
    return out


def _cross(v: Array) -> Array:
    """Matrices of v x ..., shape (n, 3, 3)."""
    return np.cross(v[:, None], np.eye(3)[None]).transpose(0, 2, 1)


def _pressed(contact: Contact) -> Contact:
    """The same wrench at its centre of pressure, where the free moment is vertical; in the middle where there is no load."""
    up = contact.force[:, 2]
    loaded = up > LOADED
    safe = np.where(loaded, up, 1.0)
    shift = np.stack([-contact.moment[:, 1] / safe, contact.moment[:, 0] / safe, np.zeros_like(up)], axis=1) * loaded[:, None]
    return replace(contact, point=contact.point + shift, moment=contact.moment - np.cross(shift, contact.force))


def projection(wrenches: Sequence[Contact]) -> Array:
    """Ground projection of the CoM n x M_o / (W . n), eq. (12) [m], shape (n, 2); in statics the CoM's x, y."""
    load = np.sum([c.force[:, 2] for c in wrenches], axis=0)
    moment = np.sum([np.cross(c.point, c.force) + c.moment for c in wrenches], axis=0)
    return np.stack([-moment[:, 1] / load, moment[:, 0] / load], axis=1)


def without(wrenches: Sequence[Contact], name: str) -> list[Contact]:
    """The same with one contact not measured."""
    return [c for c in wrenches if c.name != name]


def shifted(wrenches: Sequence[Contact], seed: int, *, cop: float = 0.002) -> list[Contact]:
    """The same with a constant error of the centre of pressure: one for all plates, as of a plate laid wrongly.

    cop: sd per horizontal axis [m].  Hands are left alone.
    """
    error = np.append(np.random.default_rng([seed, 21]).normal(0.0, cop, 2), 0.0)
    return [c if c.name.startswith("hand") else replace(c, point=c.point + error) for c in wrenches]


def offset(wrenches: Sequence[Contact], seed: int, *, force: float = 3.0, moment: float = 0.1) -> list[Contact]:
    """The same with a constant offset of each hand sensor, also while it is not touched.  force [N], moment [N m]: sd per axis."""
    rng = np.random.default_rng([seed, 22])
    out = []
    for c in wrenches:
        wrong = rng.normal(0.0, force, 3), rng.normal(0.0, moment, 3)
        out.append(replace(c, force=c.force + wrong[0], moment=c.moment + wrong[1]) if c.name.startswith("hand") else c)
    return out
