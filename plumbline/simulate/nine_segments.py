"""A body of nine segments, its forward kinematics and forty seeded people: the truth for a personal centre of mass.

Trunk with head (origin in the middle of the hips), upper arms, forearms with hands, thighs, shanks; spherical joints at hips, knees,
shoulders and elbows; ankles and hands are the distal ends. Axes: x to the person's right, y forward, z up [m]. Each segment has a
rotation from its own axes to the world's, equal to 1 while standing with hanging arms, so that a limb points along its own -z.

Every joint, and the CoM of every body without feet, is the pelvis plus one fixed vector per segment, turned with that segment:

    point = pelvis + sum_k A_k r_k            ("arms": the r_k, shape (9, 3))

Numbers: de Leva P. (1996) J Biomech 29:1223-1230, table 4, men, merged to nine segments (head into trunk at C7, hands into forearms
which end in the grip, feet into shanks) and scaled to 1.75 m; widths of hips and shoulders and the place of the feet are round numbers
of this file. A drawn person differs from the table in mass and CoM only: lengths are measured by markers, and one motion serves all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = ("upper_arm", "forearm", "thigh", "shank")  # limbs, each left and right
SEGMENTS = ("trunk", *(f"{kind}_{side}" for kind in KINDS for side in "lr"))
INDEX = {name: i for i, name in enumerate(SEGMENTS)}
PARENTS = (-1, 0, 0, 1, 2, 0, 0, 5, 6)  # of each segment; -1: the world
JOINTS = ("pelvis", *(f"{joint}_{side}" for joint in ("shoulder", "elbow", "hand", "hip", "knee", "ankle") for side in "lr"))
SCALE = 1.75 / 1.741  # [1] stature over the table's mean man

MASS = {"trunk": 0.5040, "upper_arm": 0.0271, "forearm": 0.0223, "thigh": 0.1416, "shank": 0.0570}  # [1] share of the body, merged
LENGTH = {"upper_arm": 0.2817 * SCALE, "forearm": 0.3370 * SCALE, "thigh": 0.4222 * SCALE, "shank": 0.4403 * SCALE}  # [m]
COM = {"upper_arm": 0.5772, "forearm": 0.5388, "thigh": 0.4095, "shank": 0.6013}  # [1] of the length from the proximal end, merged
TRUNK_COM = 0.3527 * SCALE  # [m] of trunk with head above the hips
SHOULDER = (0.19, 0.0, 0.5155 * SCALE)  # [m] of the right one from the pelvis
HIP = (0.09, 0.0, 0.0)  # [m] the same
FOOT_MASS = 0.0137  # [1] share of the body, of each foot
SHANK_COM = 0.4395  # [1] of the length, without the foot
FOOT = (0.0, 0.054, -0.0495 * SCALE)  # [m] CoM of a foot from its ankle while it stands flat
ANKLE = 0.07  # [m] height of the ankles over the floor

# how much people differ from the table
MASS_SD, COM_SD, TRUNK_SD = 0.10, 0.05, (0.003, 0.012, 0.018)  # [1], [1], [m] lateral, forward, up
OFF_AXIS, ASYMMETRY, BIAS = 0.006, 0.03, 0.001  # [m], [1], [m]


@dataclass(frozen=True)
class Body:
    """The masses of one person.

    masses: shares of the body [1], shape (9,), together with `feet` one.  coms: places in the segment's own axes from its proximal end
    (trunk: from the pelvis) [m], shape (9, 3).  feet: share of each foot [1], shape (2,), zero where the shank carries it.
    foot: CoM of each foot from its ankle in the foot's own axes [m], shape (2, 3).
    bias: constant of the measured ground projection (x, y) [m], shape (2,).  mass [kg].
    """

    participant_id: str
    masses: Array
    coms: Array
    feet: Array
    foot: Array
    bias: Array
    mass: float = 70.0

    def arms(self) -> Array:
        """Vectors r_k of the CoM without the turning of the feet: pelvis + sum A_k r_k [m], shape (9, 3)."""
        own = np.zeros((9, 3))
        for i, name in enumerate(SEGMENTS):
            start = point(_proximal(name))
            own += self.masses[i] * start
            own[i] += self.masses[i] * self.coms[i]
        return np.asarray(own + self.feet[0] * point("ankle_l") + self.feet[1] * point("ankle_r"))

    def com(self, pelvis: Array, rotations: Array, feet: Array | None = None) -> Array:
        """True CoM [m], shape (n, 3).

        pelvis [m], shape (n, 3).  rotations: segment to world, shape (n, 9, 3, 3).  feet: the same of left and right foot, shape
        (n, 2, 3, 3); None: flat on the floor.
        """
        body = place(pelvis, rotations, self.arms())
        if feet is None:
            return np.asarray(body + self.feet @ self.foot)
        return np.asarray(body + np.einsum("s,nsij,sj->ni", self.feet, feet, self.foot))


def _proximal(name: str) -> str:
    """The joint a segment hangs from."""
    kind, _, side = name.rpartition("_")
    return {"upper_arm": "shoulder_", "forearm": "elbow_", "thigh": "hip_", "shank": "knee_"}[kind] + side if kind else "pelvis"


def point(joint: str) -> Array:
    """Vectors r_k of a joint: pelvis + sum A_k r_k [m], shape (9, 3)."""
    arms = np.zeros((9, 3))
    name, _, side = joint.partition("_")
    if name == "pelvis":
        return arms
    upper = name in ("shoulder", "elbow", "hand")
    arms[0] = SHOULDER if upper else HIP
    arms[0, 0] *= -1 if side == "l" else 1
    chain = ("upper_arm", "forearm") if upper else ("thigh", "shank")
    for kind in chain[: ("shoulder", "elbow", "hand").index(name) if upper else ("hip", "knee", "ankle").index(name)]:
        arms[INDEX[f"{kind}_{side}"], 2] = -LENGTH[kind]
    return arms


def place(pelvis: Array, rotations: Array, arms: Array) -> Array:
    """pelvis + sum A_k r_k [m], shape (n, 3).  pelvis [m], shape (n, 3).  rotations, shape (n, 9, 3, 3).  arms: r_k, shape (9, 3)."""
    turned: Array = np.einsum("nkij,kj->ni", rotations, arms)
    return pelvis + turned


def joints(pelvis: Array, rotations: Array) -> dict[str, Array]:
    """Forward kinematics: every joint [m], each of shape (n, 3)."""
    return {name: place(pelvis, rotations, point(name)) for name in JOINTS}


def table() -> Body:
    """The mean person of the table, feet in the shanks: what is known of a person without calibration."""
    names = [name.rpartition("_")[0] or name for name in SEGMENTS]
    masses = np.array([MASS[name] for name in names])
    coms = np.array([[0.0, 0.0, TRUNK_COM if name == "trunk" else -COM[name] * LENGTH[name]] for name in names])
    return Body("table", masses / masses.sum(), coms, np.zeros(2), np.tile(FOOT, (2, 1)), np.zeros(2))


def draw_subject(seed: int, *, hidden: bool = True) -> Body:
    """A person drawn from a seed.

    Masses of each pair x exp(0.10 N), then scaled to a whole of one; CoM of each pair of limbs along its axis x (1 + 0.05 N); CoM of
    the trunk + N(12, 3, 18 mm) forward, lateral, up.
    hidden: also what a nine-segment chain with tied sides does not know: feet that stay flat, limb CoM 6 mm off their axis in a random
    direction across it, masses and CoM places of the left x (1 + 0.03 N) and of the right x (1 - the same), and a constant
    of sd 1 mm in each axis of the ground projection.
    """
    rng = np.random.default_rng([seed, 5])
    mean = table()
    masses, coms = mean.masses.copy(), mean.coms.copy()
    pair = np.array([0, *np.repeat(np.arange(1, 5), 2)])
    masses *= np.exp(MASS_SD * rng.normal(size=5))[pair]
    coms[1:] *= (1 + COM_SD * rng.normal(size=4))[pair[1:] - 1, None]
    coms[0] += rng.normal(0.0, TRUNK_SD)
    plain = replace(mean, participant_id=f"sub-{seed:02d}", masses=masses / masses.sum(), coms=coms)
    return _hide(plain, rng) if hidden else plain


def cohort(n: int = 40, *, hidden: bool = True) -> list[Body]:
    """The first n seeded people."""
    return [draw_subject(seed, hidden=hidden) for seed in range(1, n + 1)]


def _hide(body: Body, rng: np.random.Generator) -> Body:
    """The same person with feet, CoM off the axes, different sides and a biased ground projection."""
    masses, coms, feet = body.masses.copy(), body.coms.copy(), np.zeros(2)
    shank = [INDEX["shank_l"], INDEX["shank_r"]]
    # the foot takes its share of the drawn shank; what is left keeps the drawn place along the axis in proportion
    feet[:] = masses[shank] * FOOT_MASS / MASS["shank"]
    masses[shank] -= feet
    coms[shank] *= SHANK_COM / COM["shank"]
    side = np.where(np.arange(8) % 2 == 0, 1.0, -1.0)
    masses[1:] *= 1 + side * np.repeat(ASYMMETRY * rng.normal(size=4), 2)
    coms[1:] *= 1 + (side * np.repeat(ASYMMETRY * rng.normal(size=4), 2))[:, None]
    feet *= 1 + side[:2] * ASYMMETRY * rng.normal()
    angle = rng.uniform(0.0, 2 * np.pi, 8)
    coms[1:, :2] += OFF_AXIS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    whole = masses.sum() + feet.sum()
    return replace(body, masses=masses / whole, coms=coms, feet=feet / whole, bias=rng.normal(0.0, BIAS, 2))
