r"""Loci side by side: the CoM, its velocity and the ZMP of many loci as arrays that estimators work on at once.

The law needs x and x' without the lag of a filter and right up to both ends of a locus. They are taken as the motion that the plant
gives for the measured ZMP, :math:`\ddot x = \omega^2 (x - p)`, plus the slow rest of the measured CoM: the plant carries what is
fast (the ZMP's millimetre of noise, integrated twice, leaves 0.1 mm), the rest what the plant lacks. Nothing is smeared over a switch.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from plumbline.models.com_zmp import free_motion

Array = NDArray[np.float64]

BEND = 2.0  # [Hz] the rest above is taken as noise
LEAD = 0.3  # [s] of motion before a locus, for laws that act late


@dataclass(frozen=True)
class Batch:
    """m loci of at most n frames; row `lead` is each one's first frame, rows before it are its past.

    x: CoM [m], v: its velocity [m/s], p: measured ZMP [m]; all (n, m), the last value repeated after row `end` (m,).
    rate [Hz].
    """

    rate: float
    lead: int
    end: NDArray[np.int64]
    x: Array
    v: Array
    p: Array

    @property
    def inside(self) -> NDArray[np.bool_]:
        """True on the frames of a locus, (n, m); False in its past and after its end."""
        row = np.arange(len(self.x))[:, None]
        return (row >= self.lead) & (row < self.end)

    def take(self, loci: NDArray[np.int64] | NDArray[np.bool_]) -> "Batch":
        """Some of the loci.  loci: indices or mask."""
        return Batch(self.rate, self.lead, self.end[loci], self.x[:, loci], self.v[:, loci], self.p[:, loci])

    def late(self, delay: float) -> "Batch":
        """The CoM and its velocity as they were `delay` [s] (whole frames, at most LEAD) earlier, beside today's ZMP."""
        rows = round(delay * self.rate)
        x, v = (np.concatenate([one[:1].repeat(rows, 0), one[: len(one) - rows]]) for one in (self.x, self.v))
        return Batch(self.rate, self.lead, self.end, x, v, self.p)

    def thinned(self, rate: float) -> "Batch":
        """Every k-th frame, at `rate` [Hz] or a little above; p is averaged with the weights 1/4, 1/2, 1/4 over a step before."""
        step = int(self.rate / rate + 1e-9)
        if step < 2:
            return self
        first = self.lead % step
        rows = slice(first, None, step)
        half = step // 2
        p = (np.roll(self.p, half, 0) + 2 * self.p + np.roll(self.p, -half, 0)) / 4
        p[:half], p[-half:] = self.p[:half], self.p[-half:]
        end = self.lead // step + -(-(self.end - self.lead) // step)
        return Batch(self.rate / step, self.lead // step, end, self.x[rows], self.v[rows], p[rows])


def smoothed(x: Array, p: Array, omega: float, rate: float) -> tuple[Array, Array]:
    """CoM [m] and velocity [m/s] of one locus: the plant's motion for the measured ZMP plus the slow rest.

    x, p: measured [m], shape (n,), no NaN, n >= 4.  omega [rad/s].  rate [Hz].
    """
    free, speed = free_motion(x, p, omega, rate)
    rest = slow(x - free, rate, BEND)
    return free + rest, speed + np.gradient(rest, 1 / rate)


def slow(y: Array, rate: float, bend: float) -> Array:
    """Whittaker smoother with a penalty on third differences: half the amplitude at `bend` [Hz], whole parabolas pass, ends included.

    y: (n,), n >= 4, no NaN.  rate [Hz].  Returns (n,).
    """
    weight = (2 * np.sin(np.pi * bend / rate)) ** -6
    band = np.zeros((4, len(y)))
    step = np.array([-1.0, 3.0, -3.0, 1.0])
    for i in range(4):
        for j in range(i, 4):
            band[3 - (j - i), j : len(y) - 3 + j] += weight * step[i] * step[j]
    band[3] += 1.0
    return np.asarray(solveh_banded(band, y))


def of_loci(x: Sequence[Array], p: Sequence[Array], omega: float, rate: float, past: Sequence[tuple[Array, Array]] | None = None) -> Batch:
    """A batch of measured loci.

    x, p: CoM and ZMP of each locus [m], no NaN.  omega [rad/s] of the plant that smooths.  past: measured position and velocity of the
    CoM just before each locus, oldest first; where it is shorter than LEAD, the CoM is taken to have moved uniformly.
    """
    lead = round(LEAD * rate)
    long = max(len(one) for one in x)
    out = np.zeros((3, lead + long, len(x)))
    for k, (place, zmp) in enumerate(zip(x, p, strict=True)):
        n = len(place)
        out[:2, lead : lead + n, k] = smoothed(place, zmp, omega, rate)
        out[2, lead : lead + n, k] = zmp
        out[:, lead + n :, k] = out[:, lead + n - 1, k, None]
        out[2, :lead, k] = zmp[0]
        out[:2, :lead, k] = _before(out[:2, lead, k], past[k] if past else (zmp[:0], zmp[:0]), lead, rate)
    return Batch(rate, lead, lead + np.array([len(one) for one in x]), *out)


def _before(start: Array, past: tuple[Array, Array], lead: int, rate: float) -> Array:
    """Position and velocity in the `lead` frames before a locus, (2, lead)."""
    known = min(len(past[0]), lead)
    out = np.empty((2, lead))
    out[:, lead - known :] = np.stack([one[len(one) - known :] for one in past])
    first = out[:, lead - known] if known else start
    gap = lead - known
    back = np.arange(-gap, 0) / rate
    out[0, :gap], out[1, :gap] = first[0] + first[1] * back, first[1]
    return out
