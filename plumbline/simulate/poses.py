"""Named poses that a person can hold for a few seconds: standing, leaning, on one leg, sitting, kneeling, lying.

Angles are degrees about x, y, z of the parent's axes (`tasks.posed`). Standing poses are asked for as posture only: the feet stay where
they stand and the CoM of the table goes over them first, so that the pose is one that does not fall over. Lying and kneeling poses are
taken as they are, the lowest joint on the floor; there the world's vertical meets what was forward or sideways in the body.

No paper: candidates for the next pose to record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from plumbline.simulate import nine_segments as nine
from plumbline.simulate import tasks
from plumbline.simulate.multi_contact import FOOT_MIDDLE, SEAT, STANCE, Motion, ankles, seat, soles, start, times
from plumbline.simulate.nine_segments import INDEX, Array
from plumbline.simulate.tasks import Pose, Target
from plumbline.simulate.wrenches import Plate

THICK = 0.06  # [m] from the floor up to the lowest joint of a lying or kneeling person
Angles = Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Stance:
    """A pose by its joint angles and what carries it.

    angles: segment -> degrees about x, y, z.  on: "feet", "left foot", "seat" or "floor".
    """

    angles: Angles = field(default_factory=dict)
    on: str = "feet"


def _both(**limbs: tuple[float, float, float]) -> dict[str, tuple[float, float, float]]:
    """Angles of both sides; the turns about y and z are mirrored on the right."""
    out = {}
    for name, (x, y, z) in limbs.items():
        if name == "trunk":
            out[name] = (x, y, z)
        else:
            out[f"{name}_l"], out[f"{name}_r"] = (x, y, z), (x, -y, -z)
    return out


POSES: dict[str, Stance] = {
    "upright": Stance(_both(thigh=(4, 0, 0), shank=(-8, 0, 0), forearm=(10, 0, 0))),
    "arms forward": Stance(_both(upper_arm=(90, 0, 0), thigh=(4, 0, 0), shank=(-8, 0, 0))),
    "arms up": Stance(_both(upper_arm=(170, 0, 0), thigh=(4, 0, 0), shank=(-8, 0, 0))),
    "arms sideways": Stance(_both(upper_arm=(0, 88, 0), thigh=(4, 0, 0), shank=(-8, 0, 0))),
    "elbows bent": Stance(_both(forearm=(130, 0, 0), thigh=(4, 0, 0), shank=(-8, 0, 0))),
    "lean 30": Stance(_both(trunk=(-30, 0, 0), thigh=(38, 0, 0), shank=(-8, 0, 0), upper_arm=(30, 0, 0))),
    "lean 60": Stance(_both(trunk=(-60, 0, 0), thigh=(70, 0, 0), shank=(-10, 0, 0), upper_arm=(60, 0, 0))),
    "lean 60, arms up": Stance(_both(trunk=(-60, 0, 0), thigh=(75, 0, 0), shank=(-20, 0, 0), upper_arm=(170, 0, 0))),
    "lean back": Stance(_both(trunk=(15, 0, 0), thigh=(5, 0, 0), shank=(-30, 0, 0), upper_arm=(30, 0, 0))),
    "lean left": Stance({**_both(thigh=(4, 0, 0), shank=(-8, 0, 0)), "trunk": (0, -20, 0)}),
    "lean right": Stance({**_both(thigh=(4, 0, 0), shank=(-8, 0, 0)), "trunk": (0, 20, 0)}),
    "squat": Stance(_both(trunk=(-35, 0, 0), thigh=(110, 0, 0), shank=(-100, 0, 0), upper_arm=(90, 0, 0))),
    "left foot, knee up": Stance({**_both(shank=(-5, 0, 0), thigh=(2, 0, 0)), "thigh_r": (90, 0, 0), "shank_r": (-90, 0, 0)}, "left foot"),
    "left foot, leg forward": Stance({**_both(shank=(-5, 0, 0)), "thigh_r": (60, 0, 0)}, "left foot"),
    "left foot, leg sideways": Stance({**_both(shank=(-5, 0, 0)), "thigh_r": (0, -35, 0)}, "left foot"),
    "seated": Stance(_both(thigh=(85, 0, 0), shank=(-95, 0, 0)), "seat"),
    "seated, arms up": Stance(_both(thigh=(85, 0, 0), shank=(-95, 0, 0), upper_arm=(170, 0, 0)), "seat"),
    "seated, lean 40": Stance(_both(trunk=(-40, 0, 0), thigh=(125, 0, 0), shank=(-95, 0, 0), upper_arm=(40, 0, 0)), "seat"),
    "kneeling": Stance(_both(shank=(-90, 0, 0)), "floor"),
    "on all fours": Stance(_both(trunk=(-82, 0, 0), thigh=(82, 0, 0), shank=(-90, 0, 0), upper_arm=(80, 0, 0)), "floor"),
    "supine": Stance(_both(trunk=(90, 0, 0)), "floor"),
    "supine, arms up": Stance(_both(trunk=(90, 0, 0), upper_arm=(175, 0, 0)), "floor"),
    "supine, knees up": Stance(_both(trunk=(90, 0, 0), thigh=(60, 0, 0), shank=(-110, 0, 0)), "floor"),
    "prone": Stance(_both(trunk=(-90, 0, 0)), "floor"),
    "prone, arms up": Stance(_both(trunk=(-90, 0, 0), upper_arm=(175, 0, 0)), "floor"),
    "on the left side": Stance({"trunk": (0, -90, 0)}, "floor"),
    "on the right side": Stance({"trunk": (0, 90, 0)}, "floor"),
}


def hold(pose: str | Stance, seconds: float = 5.0, rate: float = 100.0) -> Motion:
    """A pose, named or given, held still.

    Raises KeyError for an unknown name, tasks.Unreachable for a pose that feet or seat do not allow.
    """
    stance = POSES[pose] if isinstance(pose, str) else pose
    time = times(seconds, rate)
    n = len(time)
    still, plates, turned = _lying(stance) if stance.on == "floor" else _standing(stance)
    held = Pose(np.tile(still.pelvis, (n, 1)), np.tile(still.rotations, (n, 1, 1, 1)))
    feet = None if turned is None else np.tile(turned, (n, 1, 1, 1))
    spread = tuple(Plate(plate.name, np.tile(plate.point, (n, 1)), np.tile(plate.share, n)) for plate in plates)
    return Motion(time, held, spread, feet=feet)


def _standing(stance: Stance) -> tuple[Pose, list[Plate], Array | None]:
    """On one foot, both, or the seat; a lifted foot turns with its shank."""
    posture = tasks.posed(stance.angles)
    begin = Pose(start(1).pelvis, tasks.composed(posture)[None])
    fixed, plates = ankles(1), list(soles(1))
    if stance.on == "seat":
        fixed.append(Target(nine.point("pelvis"), np.array([SEAT])))
        return tasks.solve(begin, [fixed], posture), [*plates, seat(1, np.ones(1))], None
    middle = 0.0
    if stance.on == "left foot":
        fixed, plates, middle = fixed[:1], plates[:1], -STANCE
    over = Target(nine.table().arms(), np.array([[middle, FOOT_MIDDLE, 0.0]]), (0, 1))
    pose = tasks.solve(begin, [fixed, [over]], posture)
    if stance.on == "feet":
        return pose, plates, None
    return pose, plates, np.stack([np.eye(3), pose.rotations[0, INDEX["shank_r"]]])[None]


def _lying(stance: Stance) -> tuple[Pose, list[Plate], Array | None]:
    """On the floor, the lowest joint on it; the feet turn with their shanks, stretched where those lie flat on the front."""
    rotations = tasks.composed(tasks.posed(stance.angles))[None]
    heights = np.concatenate(list(nine.joints(np.zeros((1, 3)), rotations).values()))[:, 2]
    pelvis = np.array([[0.0, 0.0, THICK - heights.min()]])
    shanks = rotations[0, [INDEX["shank_l"], INDEX["shank_r"]]]
    point_toes = Rotation.from_euler("x", -60.0, degrees=True).as_matrix()
    prone = shanks[:, 1, 2] > 0.9  # the shank's upward axis points forward: it lies on its front
    feet = np.where(prone[:, None, None], shanks @ point_toes, shanks)
    middle = nine.place(pelvis, rotations, nine.table().arms()) * [1.0, 1.0, 0.0]
    return Pose(pelvis, rotations), [Plate("floor", middle, np.ones(1))], feet[None]
