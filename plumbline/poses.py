"""Poses that a person could hold for a calibration, made from how that person stands: what to record next is chosen among them.

A pose is a list of turns of parts of the body about a joint, from the proximal end on. Only directions matter for what a pose tells,
so a stick figure of the person's own lengths is enough. Turns are seen from the person's right: positive is forward (arm up ahead,
knee up ahead, trunk bent ahead).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from plumbline.body import Body
from plumbline.person_com import heading

Array = NDArray[np.float64]

LEG, SHIN, FOOT = ("thigh", "shank", "foot"), ("shank", "foot"), ("foot",)
ARM, LOWER_ARM = ("upper_arm", "forearm", "hand"), ("forearm", "hand")


class Turn(NamedTuple):
    """parts: segments without their side; empty: the whole body, "upper": all but the legs.  degrees, about the axis `about`
    (lateral, forward), at the proximal end of the first part.  sides: which of a pair."""

    parts: tuple[str, ...]
    degrees: float
    about: str = "lateral"
    sides: tuple[str, ...] = ("right", "left")


UPPER = ("upper",)
SQUAT = (Turn(LEG, 70.0), Turn(SHIN, -110.0), Turn(FOOT, 40.0))
SIT = (Turn(LEG, 85.0), Turn(SHIN, -85.0))

POSES: Mapping[str, tuple[Turn, ...]] = {
    "stand upright, arms down": (),
    "stand, both arms straight ahead": (Turn(ARM, 90.0),),
    "stand, both arms up": (Turn(ARM, 175.0),),
    "stand, both arms to the sides": (Turn(ARM, 85.0, "forward"),),
    "stand, one arm to the side": (Turn(ARM, 85.0, "forward", ("right",)),),
    "stand, trunk bent 30 degrees ahead": (Turn(UPPER, 30.0),),
    "stand, trunk bent 60 degrees ahead": (Turn(UPPER, 60.0),),
    "stand, trunk bent 60 degrees ahead, arms ahead": (Turn(UPPER, 60.0), Turn(ARM, 110.0)),
    "stand, trunk leant 25 degrees to the side": (Turn(UPPER, 25.0, "forward"),),
    "squat, arms ahead": (*SQUAT, Turn(UPPER, 35.0), Turn(ARM, 110.0)),
    "half squat": (Turn(LEG, 40.0), Turn(SHIN, -65.0), Turn(FOOT, 25.0), Turn(UPPER, 20.0)),
    "stand on one leg, the other thigh level": (Turn(LEG, 85.0, "lateral", ("right",)), Turn(SHIN, -85.0, "lateral", ("right",))),
    "stand on one leg, the other straight ahead": (Turn(LEG, 50.0, "lateral", ("right",)),),
    "stand on one leg, the other to the side": (Turn(LEG, 35.0, "forward", ("right",)),),
    "sit on a plate, upright": SIT,
    "sit on a plate, trunk bent 45 degrees ahead": (*SIT, Turn(UPPER, 45.0)),
    "sit on a plate, knees straight": (Turn(LEG, 85.0),),
    "kneel on a plate, upright": (Turn(SHIN, -90.0),),
    "lie on the back on a plate": (Turn((), -90.0),),
    "lie on the back on a plate, knees up": (Turn((), -90.0), Turn(LEG, 60.0), Turn(SHIN, -110.0)),
    "lie on the side on a plate": (Turn((), 90.0, "forward"),),
}


def straight(body: Body) -> Body:
    """A body of one frame with hanging arms and straight legs under it: joints stay where they are, limbs point down.

    body: arrays (1, s, 3). Feet and hands keep how they point.
    """
    p, d = body.proximal.copy(), body.distal.copy()
    for parts in (LEG, ARM):
        for side in ("right", "left"):
            chain = [body.names.index(f"{part}_{side}") for part in parts if f"{part}_{side}" in body.names]
            for k, i in enumerate(chain):
                if k:
                    shift = d[0, chain[k - 1]] - body.distal[0, chain[k - 1]]
                    p[0, i], d[0, i] = p[0, i] + shift, d[0, i] + shift
                if k < 2:
                    d[0, i] = p[0, i] - np.array([0.0, 0.0, np.linalg.norm(d[0, i] - p[0, i])])
    return replace(body, proximal=p, distal=d)


def posed(body: Body, name: str) -> Body:
    """A standing body of one frame in a pose of :data:`POSES`.  body: arrays (1, s, 3).  Raises KeyError for an unknown pose."""
    p, d = body.proximal[0].copy(), body.distal[0].copy()
    right = heading(body)[0]
    ahead = np.cross([0.0, 0.0, 1.0], right)
    for turn in POSES[name]:
        axis = right if turn.about == "lateral" else -ahead
        for members, pivot in _groups(body.names, p, turn):
            spin = Rotation.from_rotvec(np.radians(_sense(turn, members, body.names)) * axis)
            p[members], d[members] = pivot + spin.apply(p[members] - pivot), pivot + spin.apply(d[members] - pivot)
    return replace(body, proximal=p[None], distal=d[None], filled=np.zeros(1, dtype=bool), missing=[], notes=[])


def _sense(turn: Turn, members: list[int], names: list[str]) -> float:
    """Degrees about the axis.  To the front: a limb, which hangs, turns the other way than a trunk, which stands; outward: by side."""
    hangs = turn.parts not in ((), UPPER)
    if turn.about == "lateral":
        return turn.degrees if hangs else -turn.degrees
    left = hangs and names[members[0]].endswith("_left")
    return -turn.degrees if left else turn.degrees


def _groups(names: list[str], p: Array, turn: Turn) -> list[tuple[list[int], Array]]:
    """Segments that turn together, and the joint about which."""
    if not turn.parts:
        return [(list(range(len(names))), p.mean(axis=0))]
    legs = [i for i, n in enumerate(names) if n.removesuffix("_right").removesuffix("_left") in LEG]
    if turn.parts == UPPER:
        hips = [i for i in legs if names[i].startswith("thigh")] or legs
        rest = [i for i in range(len(names)) if i not in legs]
        return [(rest, p[hips].mean(axis=0) if hips else p.mean(axis=0))] if rest else []
    out = []
    for side in turn.sides:
        members = [names.index(f"{part}_{side}") for part in turn.parts if f"{part}_{side}" in names]
        if members:
            out.append((members, p[members[0]].copy()))
    return out
