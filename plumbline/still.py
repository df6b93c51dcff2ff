r"""Still windows of a recording: where the ground projection of the CoM can be measured, and where not and why.

At rest the contact forces together have no horizontal moment about the CoM's ground projection (Gonzalez 2013, eq. 12):
:math:`(x, y) = n \times M_o / (W \cdot n)`, with :math:`W \cdot n` the positive vertical load; this is the ZMP of the net wrench of
all plates, handles and seats that were measured. It is the CoM's only if nothing accelerates and nothing pushes unseen. Motion moves
it by :math:`z \ddot x / g`, told from the markers: the shear of a plate has zero errors of as many mm. A vertical load that is not body
weight, or a steady force to the side, says that something touches the person that no plate measured.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.body import Body
from plumbline.filters import known
from plumbline.forces import Forces
from plumbline.person_com import Columns, columns
from plumbline.physics import G

Array = NDArray[np.float64]

FEWEST = 6  # frames in a window
LOAD = 0.02  # [1] of body weight that may be missing or too much
PULL = 0.01  # [1] of body weight to the side in somebody who is still; zero errors of a plate's shear reach half of it
SPEED = 0.05  # [m/s] of the CoM, from which on a pose is no longer one


class Gate(NamedTuple):
    """length: of a window [s].  limit: by how much motion may move the ZMP off the CoM [m]."""

    length: float = 1.0
    limit: float = 0.002


@dataclass(frozen=True)
class Window:
    """One window of a trial; vectors are means over it.

    middle, length [s].  samples: frames in it.  reason: empty where it is used.  load: of body weight [1].  shift: z F_h / F_z [m].
    ground: measured projection [m] (2,).  table: CoM of the segment table [m] (3,).  basis (3, q).  directions (s, 3).
    """

    middle: float
    length: float
    samples: int
    reason: str
    load: float
    shift: float
    ground: Array
    table: Array
    basis: Array
    directions: Array


def windows(body: Body, force: Forces, time: Array, mass: float, gate: Gate, tied: bool = False) -> tuple[Columns, list[Window]]:
    """Columns of a trial (all frames) and its windows, one after the other.

    time: [s], shape (n,), even.  mass [kg].  tied: left and right are alike.
    """
    made = columns(body, tied)
    return made, list(_windows(made, force, time, mass, gate))


def _windows(c: Columns, force: Forces, time: Array, mass: float, gate: Gate) -> Iterator[Window]:
    step = float(np.median(np.diff(time))) if len(time) > 1 else np.inf
    n = max(round(gate.length / step), FEWEST) if np.isfinite(step) else FEWEST
    for start in range(0, len(time) - n + 1, n):
        w = slice(start, start + n)
        with np.errstate(invalid="ignore"):
            load = float(np.mean(force.grf[w, 2])) / (mass * G)
            lean = np.mean(force.grf[w, :2], axis=0) / (load * mass * G)
            height = float(np.mean(c.table[w, 2])) - force.surface
            shift = float(np.linalg.norm(lean) * height)
        yield Window(
            float(np.mean(time[w])), n * step, n, _reason(c.table[w], force.zmp[w], load, shift, step, height, gate), load, shift,
            force.zmp[w, :2].mean(axis=0), c.table[w].mean(axis=0), c.basis[w].mean(axis=0), c.directions[w].mean(axis=0),
        )  # fmt: skip


def _reason(table: Array, zmp: Array, load: float, shift: float, step: float, height: float, gate: Gate) -> str:
    """Why a window says nothing of the CoM, in words; empty where it does."""
    if not known(table).all():
        return "no CoM from markers in all of its frames"
    if not known(zmp).all():
        return "no centre of pressure in all of its frames"
    speed = float(np.linalg.norm(table[-1] - table[0])) / ((len(table) - 1) * step)
    if speed > SPEED:
        return f"moving at {speed:.2f} m/s"
    thirds = [part.mean(axis=0) for part in np.array_split(table, 3)]
    curve = np.linalg.norm((thirds[0] - 2.0 * thirds[1] + thirds[2])[:2]) / (len(table) * step / 3.0) ** 2
    moved = float(curve) * height / G
    if moved > gate.limit:
        return f"motion moves the ZMP by {1e3 * moved:.1f} mm"
    if not np.isfinite(load):
        return "body mass or vertical load not known: nobody can say whether something was left unmeasured"
    if abs(load - 1.0) > LOAD:
        return f"the plates carry {load:.1%} of body weight: a hand, a seat or a person was not measured"
    if shift > PULL * height:
        return f"{shift / height:.1%} of body weight pulls to the side while nothing moves: a hand or a person was not measured"
    return ""
