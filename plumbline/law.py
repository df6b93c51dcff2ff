"""The controller of a group of loci, from arrays in memory: regimes, gains by each method, limits, noise.

Feedback noise makes least squares too small in the gains; output error and instruments are consistent. The switches are found with
the consistent law, because a gain that is 3 % too small moves a switch by some milliseconds.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline import switching
from plumbline.batch import Batch
from plumbline.estimators import instruments, output_error, saturation
from plumbline.estimators.clustered import jackknife, reach
from plumbline.estimators.instruments import Instruments
from plumbline.estimators.output_error import OutputError
from plumbline.estimators.saturation import Saturation
from plumbline.models.controller import Law
from plumbline.switching import Noise, Regime

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SHORTEST = 0.01  # [s] a delay is one where its interval lies above this
MATTERS = 0.01  # share of the misfit of CoM and ZMP that it must take off
SHOWS = 0.02  # share of the equation error that a delay must take off before it can matter to who is at a limit
SIMULATED = 50.0  # [Hz] of the closed loops simulated: poles of 5 1/s are integrated to 0.1 %, at 100 Hz the gains are the same


@dataclass(frozen=True)
class Regimes:
    """What the loci of a group show without a model of each: joint least squares, its noise, the law, regimes and switches.

    law: gains by output error, limits the mean ZMP over the frames at them.  regime: (n, m) of the batch's frames.
    """

    saturation: Saturation
    noise: Noise
    law: Law
    regime: Regime


def regimes(batch: Batch, omega: float, steady: Mask) -> Regimes | None:
    """Find the law well enough to tell who is at a limit when.

    steady: (m,) loci that do not fall; the others show limits, and a simulated fall runs away.  None where the gains cannot be told.
    """
    first, delay = _first(batch)
    if first is None or not np.isfinite(first.law.d) or not steady.any():
        return None
    seen = batch.late(delay)
    noise = switching.noise(seen, first.law, first.limit_rms, first.inside_rms)
    regime = switching.regimes(seen, first.law, noise)
    law = switching.limits(regime, batch, first.law)
    coarse, thin = thinned(batch, regime)
    coarse, thin = coarse.take(steady), thin[:, steady]
    plain = output_error.fit(coarse, thin, law, omega)
    delayed = output_error.search(coarse, thin, plain.law, omega) if delay > 0 else None
    if delayed is not None and _late(plain, delayed):
        law, seen = delayed.law, batch.late(delayed.law.delay)
    else:
        law, seen = plain.law, batch
    regime = switching.refine(switching.regimes(seen, law, noise), seen, law, noise)
    least = first if delay == 0 else saturation.fit(batch)
    if least is None:
        return None
    known = switching.noise(batch, least.law, least.limit_rms, least.inside_rms)
    return Regimes(least, known, switching.limits(regime, batch, law), regime)


def _first(batch: Batch) -> tuple[Saturation | None, float]:
    """Joint least squares at the delay that explains the ZMP best frame by frame, and that delay [s]; 0 unless it takes SHOWS off.

    Equation error sees a delay nearly everywhere; to tell who is at a limit it does not matter whether it is one.
    """
    coarse = batch.thinned(SIMULATED)
    fits = [(float(g), saturation.fit(coarse.late(float(g)))) for g in np.arange(0.0, output_error.LONGEST, 2 * output_error.GRID)]
    cost = [got.cost if got is not None else np.inf for _, got in fits]
    best = int(np.argmin(cost))
    delay = fits[best][0] if cost[best] < (1 - SHOWS) * cost[0] else 0.0
    return saturation.fit(batch.late(delay)), delay


def thinned(batch: Batch, regime: Regime) -> tuple[Batch, Regime]:
    """Batch and regimes at the rate of the simulations."""
    coarse = batch.thinned(SIMULATED)
    every = max(1, round(batch.rate / coarse.rate))
    return coarse, regime[batch.lead % every :: every]


@dataclass(frozen=True)
class Controller:
    """A group's controller by every method.

    delayed: output error with a free delay, None where none was looked for.  instruments: at the delay of the law that `late` chooses.
    limit_se, limit_loci: standard error of (left, right) clustered by locus [m], and the loci that reached them.
    """

    saturation: Saturation
    output_error: OutputError
    delayed: OutputError | None
    instruments: Instruments | None
    limit_se: tuple[float, float]
    limit_loci: tuple[int, int]

    @property
    def late(self) -> bool:
        """Whether a delay is there: its interval lies above SHORTEST and it takes MATTERS off the misfit."""
        return _late(self.output_error, self.delayed)


def _late(plain: OutputError, delayed: OutputError | None) -> bool:
    if delayed is None:
        return False
    low = delayed.law.delay - reach(delayed.covariance[3, 3], delayed.loci)
    return bool(low > SHORTEST and delayed.misfit < (1 - MATTERS) * plain.misfit)


class Limits(NamedTuple):
    """Left and right limit of the ZMP [m], infinite where never reached; standard errors clustered by locus [m]; loci at each."""

    left: float
    right: float
    se: tuple[float, float]
    loci: tuple[int, int]


def limits(batch: Batch, regime: Regime) -> Limits:
    """Mean ZMP over the frames at each limit, over all loci of a batch: limits belong to the feet, not to a cluster of omega."""
    law = switching.limits(regime, batch, Law(0.0, 0.0, 0.0))
    found = [_limit_se(batch, regime, side, value) for side, value in ((-1, law.left), (1, law.right))]
    return Limits(law.left, law.right, (found[0][0], found[1][0]), (found[0][1], found[1][1]))


def identify(
    batch: Batch, regime: Regime, omega: float, steady: Mask, *, delay: bool = True, known: Limits | None = None
) -> Controller | None:
    """Limits from all loci and gains by each method from those that do not fall (steady, (m,)), for known regimes and omega.

    delay: look for one too (three quarters of the time).  known: limits of more loci than these.  None where the gains cannot be told.
    """
    least = saturation.fit(batch.take(steady)) if steady.any() else None
    if least is None or not np.isfinite(least.law.d):
        return None
    borders = known or limits(batch, regime)
    start = least.law._replace(left=borders.left, right=borders.right)
    coarse, thin = thinned(batch.take(steady), regime[:, steady])
    plain = output_error.fit(coarse, thin, start, omega)
    delayed = output_error.search(coarse, thin, plain.law, omega) if delay else None
    law = delayed.law if delayed is not None and _late(plain, delayed) else plain.law
    return Controller(
        least,
        plain,
        delayed,
        instruments.fit(coarse, thin, law, omega, least.inside_rms),
        borders.se,
        borders.loci,
    )


def _limit_se(batch: Batch, regime: Regime, side: int, limit: float) -> tuple[float, int]:
    """Standard error of a limit [m], clustered by locus, and the loci that reached it."""
    at = batch.inside & (regime == side)
    loci = at.any(0)
    if not loci.any():
        return float("nan"), 0
    scores = np.where(at, batch.p - limit, 0.0).sum(0)[loci, None]
    normals = at.sum(0)[loci, None, None].astype(float)
    return float(np.sqrt(jackknife(normals, scores)[0, 0])), int(loci.sum())
