r"""CoM from forces alone: double integration held in place by the CoP.

Two statements about the CoM, each good where the other is bad: :math:`\ddot x = a = F/m` (double integration drifts at low
frequencies) and :math:`x = q = p + a/\omega^2` (the gravity line: exact for a body without angular momentum; noisy at high
frequencies). The estimate minimises

.. math:: \int (\ddot x - a)^2 + \omega_c^4\,(x - q)^2 \; dt,

whose solution in the frequency domain is the zero-phase complementary filter
:math:`X = (\omega_c^4 Q - \omega^2 A)/(\omega_c^4 + \omega^4)`: below the crossover the CoP decides, above it the
force. The sum is solved as a banded system, so both ends are free and gaps need no filling. King DL, Zatsiorsky VM (1997)
Gait Posture 6:27-38 pin the double integral to the gravity line at single instants instead (zero-point to zero-point
integration).
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from plumbline.filters import known, runs
from plumbline.physics import G

Array = NDArray[np.float64]

CROSSOVER = 0.3  # [Hz] where CoP and double integral weigh the same
HEIGHT_SHARE = 0.56  # [1] CoM height over body height while standing
DEFAULT_HEIGHT = 1.70  # [m] body height where participants.tsv states none
MIN_RUN = 1.0  # [s] shorter runs are not integrated


def com_from_force(grf: Array, zmp: Array, time: Array, mass: float, height: float) -> Array:
    """CoM [m], shape (n, 3), from net reaction [N] and ZMP [m], both (n, 3), body mass [kg] and CoM height over the ZMP [m].

    The vertical is integrated about `height`. The mean acceleration of each run is taken off: 4 N of zero error in the shear would
    move the CoM by 7 mm, so its mean is that of the ZMP. NaN where force or ZMP are, and in runs shorter than `MIN_RUN`.
    """
    out = np.full((len(time), 3), np.nan)
    if not (np.isfinite(mass) and mass > 0.0) or len(time) < 5:
        return out
    step = float(np.median(np.diff(time)))
    acceleration = grf / mass - np.array([0.0, 0.0, G])
    arm = np.array([height / G, height / G, 0.0])
    for a, b in runs(known(acceleration + zmp)):
        if (b - a) * step >= MIN_RUN:
            pull = acceleration[a:b] - acceleration[a:b].mean(axis=0)
            out[a:b] = blend(pull, zmp[a:b] + pull * arm + np.array([0.0, 0.0, height]), step, CROSSOVER)
    return out


def fused(com: Array, grf: Array, time: Array, mass: float) -> Array:
    """CoM of markers held together with the force [m], (n, 3): the smoother of a double integrator, slow by `com`, fast by the force.

    The same minimum with the markers' CoM in the place of the gravity line: markers are true in the mean and soft where the body
    shakes. NaN where one of both is, and in runs shorter than `MIN_RUN`.
    """
    out = np.full((len(time), 3), np.nan)
    if not (np.isfinite(mass) and mass > 0.0) or len(time) < 5:
        return out
    step = float(np.median(np.diff(time)))
    acceleration = grf / mass - np.array([0.0, 0.0, G])
    for a, b in runs(known(acceleration + com)):
        if (b - a) * step >= MIN_RUN:
            out[a:b] = blend(acceleration[a:b] - _zero(acceleration[a:b], com[a:b], step), com[a:b], step, CROSSOVER)
    return out


def _zero(acceleration: Array, com: Array, step: float) -> Array:
    """Zero error of the force [m/s2], (3,): its mean less what the markers' CoM gained in speed from end to end."""
    n, edge = len(com), max(len(com) // 20, 2)
    gained = (com[-1] - com[-1 - edge] - com[edge] + com[0]) / (edge * step)
    return np.asarray(acceleration.mean(axis=0) - gained / ((n - edge) * step))


def blend(acceleration: Array, anchor: Array, step: float, crossover: float) -> Array:
    """Minimiser of the module's integral on an even grid.

    acceleration: [m/s2] and anchor: [m], shape (n, d).  step: [s].  crossover: [Hz].  Returns [m], shape (n, d).
    """
    n = len(anchor)
    weight = (2.0 * np.pi * crossover * step) ** 4
    mean = anchor.mean(axis=0)  # far origins cost digits: the system's condition grows with step^-4
    right = weight * (anchor - mean)
    inner = acceleration[1:-1] * step**2
    right[:-2] += inner
    right[1:-1] -= 2.0 * inner
    right[2:] += inner
    band = np.zeros((3, n))  # upper form of weight * I + D'D, D the second difference
    band[2] = weight
    band[2, :-2] += 1.0
    band[2, 1:-1] += 4.0
    band[2, 2:] += 1.0
    band[1, 1:-1] -= 2.0
    band[1, 2:] -= 2.0
    band[0, 2:] += 1.0
    return np.asarray(solveh_banded(band, right) + mean)
