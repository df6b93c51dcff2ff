r"""A person's own CoM from still poses: calibration per subject, its bands, and what to record next.

Numerics: ``plumbline/models/sesc.py``; parameters and spreads: ``plumbline/person_com.py``; windows: ``plumbline/still.py``.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from plumbline.models import sesc as model
from plumbline.models.sesc import USUAL, Noise, Posterior, Prior, Rows
from plumbline.moving import EQUATIONS, Equations
from plumbline.person_com import Columns, Parameter, turned
from plumbline.still import Window

Array = NDArray[np.float64]

Told = tuple[str, Window]  # a trial, and a still window of it

ALL = ("still", "force", "moment")
"""Equations that calibrate: the gravity line at rest; Newton and Euler in motion."""

START = (0.03, 0.03, 0.03, 0.003, 0.003)  # [m/s2], [m] noise of the equations of motion to begin with
MEMORY = 1.2  # [s] a slow trial of 13 s holds about ten independent blocks
ROUNDS = 8
MOST = 600  # windows of one fit; more are thinned evenly: neighbours say the same
FOLDS = 8  # groups of trials that are left out in turn
CHANCE = 3.0  # standard deviations of the misfit that chance alone makes
LOUDER, RAISED = (1.0, 1.6, 2.5, 4.0, 6.3), (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # [1] times the usual noise, the usual floor


@dataclass(frozen=True)
class Calibration:
    """What the recordings of a person say of the q parameters.

    count: q.  posterior: of the parameters, then of the CoP's constant error (x, y) in each recording.  rows: of the fit.  noise: with
    the floor that the data needed.  sigma: of each of `EQUATIONS` [m/s2], [m]; NaN without moving windows.  directions: of the segments
    in the still windows (k, s, 3).
    """

    count: int
    posterior: Posterior
    rows: Rows
    noise: Noise
    sigma: Array
    directions: Array

    @property
    def mean(self) -> Array:
        """Of the parameters (q,)."""
        return self.posterior.mean[: self.count]

    @property
    def covariance(self) -> Array:
        """Of the parameters (q, q)."""
        return self.posterior.covariance[: self.count, : self.count]


def calibrate(
    windows: Sequence[Told], moving: Mapping[str, Equations], prior: Prior, noise: Noise = USUAL,
    kinds: Collection[int] = range(len(EQUATIONS)),
) -> Calibration:  # fmt: skip
    """The parameters of a person from still windows, all of them used, and from equations of motion (trial -> equations), those of
    `EQUATIONS` in `kinds`. Each recording has its own constant error of the CoP, as the feet stand elsewhere on the plates.

    Where the residual of the still windows is larger than its noise and chance make it, the noise is what makes them most likely: more
    of what no chain follows, or more of everything, widens the bands. The noise of each equation of motion is what is left of it, found
    together with the parameters; windows overlap, so that `MEMORY` seconds of them count as one.
    """
    chosen = list(windows[:: -(-len(windows) // MOST)]) if windows else []
    directions = np.array([w.directions for _, w in chosen])
    q, moving = len(prior.mean), {t: e for t, e in moving.items() if len(e.time) > 1}
    constants = _Constants(q, tuple(dict.fromkeys([t for t, _ in chosen] + [*moving])))
    more = constants.width - q
    wide = Prior(np.append(prior.mean, np.zeros(more)), block_diag(prior.covariance, noise.constant**2 * np.eye(more)))

    def told(noise: Noise) -> Posterior:
        return model.batch(wide, _still(chosen, constants, noise, directions))

    chance = 1.0 + CHANCE * np.sqrt(1.0 / max(len(chosen), 1))  # two rows a window: the mean of n squares has variance 2/n
    if chosen and told(noise).misfit > chance:
        louder = [
            replace(noise, white=noise.white * k, slow=noise.slow * k, floor=f) for k in LOUDER for f in noise.floor * np.array(RAISED)
        ]
        noise = max(louder, key=lambda n: told(n).evidence)
    rows = _still(chosen, constants, noise, directions)
    sigma = np.where([k in kinds for k in range(len(EQUATIONS))], START, np.nan) if moving else np.full(len(EQUATIONS), np.nan)
    if not np.isfinite(sigma).any():
        return Calibration(q, model.batch(wide, rows), rows, noise, sigma, directions)
    posterior, both = _with_motion(rows, _moving(moving, constants, kinds), wide, sigma)
    return Calibration(q, posterior, both, noise, sigma, directions)


class _Constants(NamedTuple):
    """Where the constant errors of the CoP stand, behind the q parameters: two for each recording."""

    q: int
    trials: tuple[str, ...]

    @property
    def width(self) -> int:
        return self.q + 2 * len(self.trials)

    def column(self, trial: str, axis: int) -> int:
        return self.q + 2 * self.trials.index(trial) + axis


def _still(chosen: Sequence[Told], constants: _Constants, noise: Noise, directions: Array) -> Rows:
    """Rows of the still windows, first x then y, decorrelated."""
    if not chosen:
        return Rows(np.zeros((0, constants.width)), np.zeros(0))
    covariance = model.floor_covariance(turned(directions), noise)
    for trial in dict.fromkeys(t for t, _ in chosen):
        mine = [i for i, (t, _) in enumerate(chosen) if t == trial]
        at, n = np.array([chosen[i][1].middle for i in mine]), chosen[mine[0]][1].samples
        covariance[np.ix_(mine, mine)] += model.mean_covariance(at, chosen[mine[0]][1].length, n, noise)
    matrix, values, unit = [], [], 0.0
    for a in (0, 1):
        h = np.zeros((len(chosen), constants.width))
        h[:, : constants.q] = [w.basis[a] for _, w in chosen]
        h[np.arange(len(chosen)), [constants.column(t, a) for t, _ in chosen]] = 1.0
        rows = model.decorrelated(h, np.array([w.ground[a] - w.table[a] for _, w in chosen]), covariance)
        matrix.append(rows.matrix)
        values.append(rows.values)
        unit += rows.unit
    return Rows(np.vstack(matrix), np.concatenate(values), unit)


class _Moving(NamedTuple):
    """Rows of the equations of motion, not weighted: index in `EQUATIONS` (r,), matrix (r, q), values (r,), time between them [s]."""

    kind: NDArray[np.int_]
    matrix: Array
    values: Array
    step: float


def _moving(moving: Mapping[str, Equations], constants: _Constants, kinds: Collection[int]) -> _Moving:
    order = sorted(kinds)
    kind, matrix, values = [], [], []
    for trial, e in moving.items():
        n = len(e.time)
        m = np.zeros((len(EQUATIONS), n, constants.width))
        m[:, :, : constants.q] = e.matrix
        for a in (0, 1):
            m[EQUATIONS.index("moment_x") + a, :, constants.column(trial, a)] = 1.0
        kind.append(np.repeat(order, n))
        matrix.append(m[order].reshape(-1, constants.width))
        values.append(e.values[order].ravel())
    step = float(np.median(np.concatenate([np.diff(e.time) for e in moving.values()])))
    return _Moving(np.concatenate(kind), np.concatenate(matrix), np.concatenate(values), step)


def _with_motion(still: Rows, moving: _Moving, prior: Prior, sigma: Array) -> tuple[Posterior, Rows]:
    """Still rows and equations of motion together; the noise of the latter, `sigma`, is found in place by expectation and maximisation."""
    kind, matrix, values, step = moving
    for _ in range(ROUNDS):
        weight = np.sqrt(step / MEMORY) / sigma[kind]
        rows = Rows(np.vstack([still.matrix, weight[:, None] * matrix]), np.concatenate([still.values, weight * values]))
        found = model.batch(prior, rows)
        left = (values - matrix @ found.mean) ** 2 + np.einsum("ri,ij,rj->r", matrix, found.covariance, matrix)
        for k in np.unique(kind):
            sigma[k] = float(np.sqrt(np.mean(left[kind == k])))
    return found, rows


# -- a subject --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trial:
    """A trial of a subject: its key, what a config may call it, columns in all frames, still windows and equations of motion."""

    key: dict[str, str]
    names: frozenset[str]
    time: Array
    columns: Columns
    windows: list[Window]
    motion: Equations

    @property
    def still(self) -> list[Told]:
        """Windows that can calibrate."""
        return [(self.key["trial"], w) for w in self.windows if not w.reason]

    def moving(self, still: bool) -> Equations:
        """Equations of motion.  still: without those inside of the still windows, which calibrate already."""
        spans = [(w.middle - w.length / 2, w.middle + w.length / 2) for _, w in self.still] if still else []
        return self.motion.outside(spans)


@dataclass(frozen=True)
class Person:
    """A subject's own CoM.

    trials: with the segments that most trials have.  calibration: from all of them that calibrate.  others: trial -> the calibration
    that stands for it where it is judged: without it (without its fold, where there are many); where the user says which trials
    calibrate, the whole one. blind: trials that `others` has not seen.
    """

    subject: str
    trials: list[Trial]
    parameters: tuple[Parameter, ...]
    calibration: Calibration
    others: dict[str, Calibration]
    blind: frozenset[str]


def person(
    subject: str, trials: Sequence[Trial], wanted: Sequence[str], times: float, equations: Sequence[str] = ALL, noise: Noise = USUAL,
    left_out: Sequence[str] = (),
) -> Person | None:  # fmt: skip
    """The own CoM of one subject; None where no trial has a CoM from markers.

    wanted: tasks or trials that calibrate; empty: all but those of `left_out`.  times: the prior's spread over the published one [1].
    equations: which of `ALL` calibrate. Trials in which other segments are seen than in most do not calibrate: their parameters mean
    something else.
    """
    by_set = Counter(tuple(p.name for p in t.columns.parameters) for t in trials)
    if not by_set:
        return None
    usual = by_set.most_common(1)[0][0]
    alike = [t for t in trials if tuple(p.name for p in t.columns.parameters) == usual]
    used = [t for t in alike if calibrates(t, wanted, left_out)]
    prior = alike[0].columns.prior(times)
    still = "still" in equations
    kinds = {k for k, name in enumerate(EQUATIONS) if name.split("_")[0] in equations}

    def told(some: Sequence[Trial], noise: Noise) -> Calibration:
        return calibrate([w for t in some for w in t.still if still], {t.key["trial"]: t.moving(still) for t in some}, prior, noise, kinds)

    whole = told(used, noise)
    fold = {} if wanted or left_out else {t.key["trial"]: i % FOLDS for i, t in enumerate(used)}
    without = {k: told([t for t in used if fold[t.key["trial"]] != k], noise) for k in set(fold.values())}
    others = {t.key["trial"]: without.get(fold.get(t.key["trial"], -1), whole) for t in alike}
    seen = {t.key["trial"] for t in used} - fold.keys()
    return Person(subject, alike, alike[0].columns.parameters, whole, others, frozenset(others.keys() - seen))


def calibrates(trial: Trial, wanted: Sequence[str], left_out: Sequence[str]) -> bool:
    """Whether a trial calibrates: it is asked for, or nothing is and it is not left out for a comparison."""
    return bool(trial.names & set(wanted)) if wanted else not trial.names & set(left_out)
