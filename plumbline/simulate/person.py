"""Simulated people: fourteen segments with the proportions of de Leva 1996, and a seeded personal deviation.

Source: de Leva P. (1996) J Biomech 29:1223-1230, table 4 and its alternative end points (C7 for head and trunk, joint centres
for the shank, third knuckle for the hand). Lengths are shares of stature; the radius of gyration is the frontal one (about the
sagittal axis) and holds for both axes across the segment; segments do not spin about their long axis, so that the longitudinal
radius plays no part. Shoulder, hip and ankle places are round numbers of this file.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

PAIRED = ("thigh", "shank", "foot", "upper_arm", "forearm", "hand")

#: segment -> proximal and distal marker; paired segments have a side's letter before the label
ENDS = {
    "trunk": ("C7", "PELV"),
    "head": ("HEAD", "C7"),
    "thigh": ("HIP", "KNE"),
    "shank": ("KNE", "ANK"),
    "foot": ("HEE", "TOE"),
    "upper_arm": ("SHO", "ELB"),
    "forearm": ("ELB", "WRI"),
    "hand": ("WRI", "FIN"),
}

#: sex -> segment -> mass [% of body], CoM from the proximal end and gyration [% of length], length [mm]
DE_LEVA = {
    "M": {
        "trunk": (43.46, 51.38, 32.8, 603.3),
        "head": (6.94, 50.02, 30.3, 242.9),
        "thigh": (14.16, 40.95, 32.9, 422.2),
        "shank": (4.33, 43.95, 25.1, 440.3),
        "foot": (1.37, 44.15, 25.7, 258.1),
        "upper_arm": (2.71, 57.72, 28.5, 281.7),
        "forearm": (1.62, 45.74, 27.6, 268.9),
        "hand": (0.61, 79.00, 62.8, 86.2),
    },
    "F": {
        "trunk": (42.57, 49.64, 30.7, 614.8),
        "head": (6.68, 48.41, 27.1, 243.7),
        "thigh": (14.78, 36.12, 36.9, 368.5),
        "shank": (4.81, 43.52, 26.7, 438.6),
        "foot": (1.29, 40.14, 29.9, 228.3),
        "upper_arm": (2.55, 57.54, 27.8, 275.1),
        "forearm": (1.38, 45.59, 26.1, 264.3),
        "hand": (0.56, 74.74, 53.1, 78.0),
    },
}
STRETCHED, ASIDE = 0.995, 0.4  # [1] of its full length a leg may reach while the hips are [m] off the middle
STATURE = {"M": 1741.0, "F": 1735.0}  # [mm] of the tables' mean man and woman


class Inertia(NamedTuple):
    """mass: share of the body [1].  com: from the proximal end, gyration: share of the length [1]."""

    mass: float
    com: float
    gyration: float


@dataclass(frozen=True)
class Subject:
    """One simulated person; lengths in m, angles in rad.

    mass [kg], height [m], sex "M" or "F".  segments: the true numbers.  nominal: the numbers of the person's sex in the table.
    lengths: per segment.  stance: distance of each ankle from the middle (marks on the
    floor, the same for everybody).  hip, shoulder: the same of hips and shoulders.
    bend: leg length while standing as a share of its full length (the knees are bent forward).  spread: angle of the arms from
    the trunk.  ankle: height of the ankles.  heel: distance of the heels behind the ankles.  foot_width: half width of a foot.
    push: height of the pushing hand above the hips as a share of the trunk.
    """

    participant_id: str
    mass: float
    height: float
    sex: str
    segments: dict[str, Inertia]
    nominal: dict[str, Inertia]
    lengths: dict[str, float]
    stance: float = 0.15
    hip: float = 0.09
    shoulder: float = 0.19
    shoulder_share: float = 0.87
    bend: float = 0.96
    spread: float = 0.15
    ankle: float = 0.07
    heel: float = 0.06
    foot_height: float = 0.03
    foot_width: float = 0.045
    push: float = 0.75

    @property
    def leg(self) -> float:
        """Distance from hip to ankle while standing [m]: `bend`, or less where the far leg could not follow a fall otherwise."""
        full, aside = self.lengths["thigh"] + self.lengths["shank"], self.stance - self.hip
        far = (STRETCHED * full) ** 2 - aside**2 - 2 * ASIDE * abs(aside)
        return min(self.bend * full, math.sqrt(far))

    @property
    def reach(self) -> float:
        """Distance of the outer edge of the feet from the middle [m]."""
        return self.stance + self.foot_width


def nominal(sex: str) -> dict[str, Inertia]:
    """The table's numbers for a sex, masses scaled to a whole of one."""
    rows = DE_LEVA[sex]
    whole = sum(row[0] * (2 if name in PAIRED else 1) for name, row in rows.items())
    return {name: Inertia(row[0] / whole, row[1] / 100, row[2] / 100) for name, row in rows.items()}


def draw_subject(
    participant_id: str,
    seed: int,
    *,
    mass: float | None = None,
    height: float | None = None,
    sex: str = "M",
    personal: float = 0.0,
) -> Subject:
    """A person drawn from a seed.

    mass [kg] and height [m] are drawn where not given; segment lengths and widths always differ by 3 % (sd) from the table's.
    personal: sd of the true segment masses and CoM places relative to the table's [1]; 0 makes the table exact.
    """
    rng = np.random.default_rng([seed, 1])
    typical = 1.78 if sex == "M" else 1.66
    tall = round(float(rng.normal(typical, 0.06)), 2) if height is None else height
    heavy = round(float(rng.normal(23.0, 2.0) * tall**2), 1) if mass is None else mass
    vary = rng.normal(1.0, 0.03, 16).clip(0.92, 1.08)
    rows = DE_LEVA[sex]
    lengths = {n: rows[n][3] / STATURE[sex] * tall * vary[i] for i, n in enumerate(rows)}
    table = nominal(sex)
    subject = Subject(participant_id, heavy, tall, sex, _personal(table, personal, rng), table, lengths)
    return replace(
        subject,
        hip=0.052 * tall * vary[8],
        shoulder=0.108 * tall * vary[9],
        ankle=0.04 * tall * vary[10],
        heel=0.034 * tall * vary[11],
    )


def _personal(table: dict[str, Inertia], personal: float, rng: np.random.Generator) -> dict[str, Inertia]:
    """The table's numbers with a personal deviation of relative sd `personal` in mass and CoM place; masses sum to one."""
    change = 1 + personal * rng.normal(0.0, 1.0, (len(table), 2)).clip(-2.5, 2.5)
    raw = {n: (row.mass * change[i, 0], row.com * change[i, 1], row.gyration) for i, (n, row) in enumerate(table.items())}
    whole = sum(row[0] * (2 if name in PAIRED else 1) for name, row in raw.items())
    return {name: Inertia(mass / whole, com, gyration) for name, (mass, com, gyration) in raw.items()}
