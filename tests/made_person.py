"""A simulated nine-segment person as the library sees one: a Body from joints, forces from the contacts."""

import numpy as np

from plumbline.body import Body
from plumbline.forces import Forces
from plumbline.segments import Numbers
from plumbline.simulate import multi_contact
from plumbline.simulate import nine_segments as nine

SIDES = {"left": "l", "right": "r"}
ENDS = {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "hand"), "thigh": ("hip", "knee"), "shank": ("knee", "ankle")}


def body(joints: dict[str, np.ndarray]) -> Body:
    """The mean person of the table between given joints, each (n, 3)."""

    def middle(name: str) -> np.ndarray:
        return (joints[f"{name}_l"] + joints[f"{name}_r"]) / 2

    names, ends = ["trunk"], [(middle("shoulder"), joints["pelvis"])]
    numbers = [Numbers(nine.MASS["trunk"], 1 - nine.TRUNK_COM / nine.SHOULDER[2], 0.3, 0.3, 0.1)]
    for kind, (start, end) in ENDS.items():
        for side, letter in SIDES.items():
            names.append(f"{kind}_{side}")
            ends.append((joints[f"{start}_{letter}"], joints[f"{end}_{letter}"]))
            numbers.append(Numbers(nine.MASS[kind], nine.COM[kind], 0.3, 0.3, 0.1))
    whole = sum(n.mass for n in numbers)
    p, d = (np.stack(e, axis=1) for e in zip(*ends, strict=True))
    return Body(names, [n._replace(mass=n.mass / whole) for n in numbers], p, d, np.zeros(len(p), bool), [], [])


def forces(recording: multi_contact.Recording) -> Forces:
    """Net force of all contacts, and the measured ground projection as the ZMP."""
    grf = np.sum([c.force for c in recording.contacts], axis=0)
    return Forces(grf, np.column_stack([recording.ground, np.zeros(len(grf))]), 0.0)
