r"""The paper's chain of seven parameters, and what an estimator gets of one recording.

Nine segments with spherical joints, left and right alike, the CoM of a limb on its axis: :math:`c = r_0 + B R` (eq. 6) with the
middle of the hips :math:`r_0`, :math:`B` = [front, right, up of the trunk | summed directions of upper arms, forearms, thighs, shanks].
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbline.body import Body
from plumbline.forces import Forces
from plumbline.person_com import Columns, heading
from plumbline.still import Gate, Window, windows

Array = NDArray[np.float64]

NAMES = ("trunk.forward", "trunk.right", "trunk.up", "upper_arm", "forearm", "thigh", "shank")
LIMBS = NAMES[3:]


@dataclass(frozen=True)
class Scene:
    """One recording of one person.

    time [s], (n,).  columns: of ours.  root [m], (n, 3).  basis: of the seven (n, 3, 7).  windows: all, with the reason of those not used.
    """

    time: Array
    columns: Columns
    root: Array
    basis: Array
    windows: Sequence[Window]

    @property
    def still(self) -> list[Window]:
        """Windows that calibrate."""
        return [w for w in self.windows if not w.reason]

    def at(self, w: Window, values: Array) -> Array:
        """Mean over a window of what is known at each instant (n, ...)."""
        start = int(np.searchsorted(self.time, w.middle - w.length / 2))
        return np.asarray(values[start : start + w.samples].mean(axis=0))

    def table_parameters(self) -> Array:
        """The seven of the segment table (7,): that table's CoM has no other part."""
        return np.asarray(np.linalg.lstsq(self.basis.reshape(-1, 7), (self.columns.table - self.root).ravel(), rcond=None)[0])


def scene(body: Body, force: Forces, time: Array, mass: float, gate: Gate | None = None) -> Scene:
    """What an estimator gets.  time: [s], (n,).  mass [kg]."""
    made, found = windows(body, force, time, mass, gate or Gate())
    root, basis = seven(body)
    return Scene(time, made, root, basis, found)


def seven(body: Body) -> tuple[Array, Array]:
    """Middle of the hips [m], (n, 3), and the basis of the paper's parameters (n, 3, 7).  Raises ValueError for other segments."""
    names = body.names
    d = body.distal - body.proximal
    u = d / np.linalg.norm(d, axis=2, keepdims=True)
    up = -u[:, names.index("trunk")]
    right = heading(body)
    right = right - np.sum(right * up, axis=1, keepdims=True) * up
    right = right / np.linalg.norm(right, axis=1, keepdims=True)
    limbs = [u[:, names.index(f"{k}_left")] + u[:, names.index(f"{k}_right")] for k in LIMBS]
    return body.distal[:, names.index("trunk")], np.stack([np.cross(up, right), right, up, *limbs], axis=2)
