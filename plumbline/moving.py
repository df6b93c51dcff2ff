r"""Moving windows of a recording as equations of the personal CoM: Newton on the markers' side, Euler on the plates'.

With the measured force per mass :math:`a = F/m` (weightlessness counted: at rest :math:`a_z = g`) every window says, in the weak form,

.. math:: \ddot c = a - g e_z, \qquad \langle a_z (q - p) - a_q z \rangle - \langle\dot\ell\rangle = 0 ,

for each horizontal axis q, z above the CoP, :math:`\ell` the angular momentum about the CoM per mass that turns z towards q. Both are
linear in how the person differs from the segment table (``plumbline/person_com.py``); the angular momentum is the table's. The first
holds whatever the CoP and the angular momentum do, and never sees a constant; the second does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbline.forces import Forces
from plumbline.person_com import Columns
from plumbline.physics import G
from plumbline.still import LOAD
from plumbline.weak import Bump

Array = NDArray[np.float64]

EQUATIONS = ("force_x", "force_y", "force_z", "moment_x", "moment_y")
HALF_WIDTH, EXPONENT = 0.3, 3  # [s] of the bump: slow tasks; shorter ones drown in the noise of x''
DELAY, VERTICAL = 0.01, 0.03  # [s] usual delay between records; [m/s2] what the vertical lacks of itself
INDEPENDENT = 1.2  # [s] of windows that count as one
STRIDE = 1 / 6  # [1] of the half width from window to window


@dataclass(frozen=True)
class Equations:
    """Rows of one trial: time [s] (k,), and for each of `EQUATIONS` matrix (5, k, q) and values (5, k), [m/s2] and [m].

    A moment row says: matrix v + constant of the CoP = values.  delay: by which the forces were late, undone in the rows [s].
    """

    time: Array
    matrix: Array
    values: Array
    delay: float = 0.0

    def outside(self, still: list[tuple[float, float]]) -> "Equations":
        """Without the windows whose middle lies in one of some spans [s]: those that calibrate as still poses already."""
        keep = np.ones(len(self.time), dtype=bool)
        for start, end in still:
            keep &= (self.time < start) | (self.time > end)
        return Equations(self.time[keep], self.matrix[:, keep], self.values[:, keep], self.delay)


def equations(c: Columns, force: Forces, ang_mom: Array, time: Array, mass: float) -> Equations:
    """Equations of a trial.  ang_mom: of the segment table about its CoM [kg m2/s], (n, 3).  time: [s], (n,), even.  mass [kg].

    Windows in which a force, a CoP or the CoM is not known, or the plates carry another load than the body's motion asks for, are
    left out; empty where no shear was recorded.
    """
    q = c.basis.shape[2]
    rate = (len(time) - 1) / float(np.ptp(time)) if len(time) > 1 else 0.0
    if rate * HALF_WIDTH < 4 or not np.isfinite(force.grf).all(axis=1).any() or not np.isfinite(mass):
        return Equations(np.zeros(0), np.zeros((5, 0, q)), np.zeros((5, 0)))
    b = Bump(HALF_WIDTH, EXPONENT, rate)
    r = c.table - np.array([0.0, 0.0, force.surface])
    late = late_by(b, force.grf[:, 2] / mass, r[:, 2], rate)
    a, p = (earlier(v, late * rate) for v in (force.grf / mass, force.zmp[:, :2]))
    pull = b.mean(a) - np.array([0.0, 0.0, G]) - b.second(r)
    down = b.mean(a[:, 2])
    curved = b.second(c.basis.reshape(len(time), -1)).reshape(c.basis.shape)
    matrix, values = [curved[:, i] for i in range(3)], [pull[:, i] for i in range(3)]
    for i, turning in ((0, ang_mom[:, 1]), (1, -ang_mom[:, 0])):
        lever = b.mean(a[:, 2] * (r[:, i] - p[:, i]) - a[:, i] * r[:, 2])
        values.append(-(lever - b.derivative(turning / mass)) / down)
        matrix.append(b.mean(a[:, 2, None] * c.basis[:, i] - a[:, i, None] * c.basis[:, 2]) / down[:, None])
    m, v = np.array(matrix), np.array(values)
    good = np.isfinite(v).all(axis=0) & np.isfinite(m).all(axis=(0, 2)) & (np.abs(pull[:, 2]) < LOAD * G)
    every = np.arange(0, len(time), max(round(HALF_WIDTH * rate * STRIDE), 1))
    pick = every[good[every]]
    return Equations(time[pick], m[:, pick], v[:, pick], late)


def late_by(b: Bump, a: Array, z: Array, rate: float) -> float:
    """By how much a force record is late behind the markers [s], from the vertical, where the segment table errs least.

    Least squares of what the vertical lacks on the slope of the force, with `DELAY` as what is likely; windows that lack more than a
    delay makes are left to a contact.  a: F_z/m [m/s2], z [m], (n,).
    """
    lack, slope = G + b.second(z) - b.mean(a), b.derivative(a)
    late = 0.0
    for _ in range(3):
        used = np.isfinite(lack + slope) & (np.abs(lack - late * slope) < LOAD * G)
        weight = 1.0 / (rate * INDEPENDENT)
        late = float(weight * (slope[used] @ lack[used]) / (weight * (slope[used] @ slope[used]) + (VERTICAL / DELAY) ** 2))
    return late


def earlier(values: Array, samples: float) -> Array:
    """A record put back by some samples, linear between them; NaN where it was, and at the ends.  values: (n, d)."""
    at = np.arange(len(values)) + samples
    out = np.full(values.shape, np.nan)
    for k in range(values.shape[1]):
        out[:, k] = np.interp(at, np.arange(len(values)), values[:, k], np.nan, np.nan)
    return out
