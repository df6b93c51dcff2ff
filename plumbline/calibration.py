r"""A person's own CoM from still poses: calibration per subject, its bands, and what to record next.

Numerics: ``plumbline/models/sesc.py``; parameters and spreads: ``plumbline/person_com.py``; windows: ``plumbline/still.py``.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from plumbline.models import sesc as model
from plumbline.models.sesc import USUAL, Noise, Posterior, Prior, Rows
from plumbline.person_com import Columns, Parameter, turned
from plumbline.still import Window

Array = NDArray[np.float64]

MOST = 600  # windows of one fit; more are thinned evenly: neighbours say the same
FOLDS, QUARTERS = 8, 4  # groups of trials, or pieces of the only one, that are left out in turn
COARSEST = 0.02  # [m] floor beyond which the data do not fit a chain at all


@dataclass(frozen=True)
class Calibration:
    """What still windows say of a person.

    posterior: of the parameters.  rows: of the fit, first all x then all y.  constant: what a constant error of the CoP does to
    them (r, 2).  noise: as used, with the floor that the data needed.  directions: of the segments in the windows (k, s, 3).
    """

    posterior: Posterior
    rows: Rows
    constant: Array
    noise: Noise
    directions: Array


def calibrate(windows: Sequence[tuple[str, Window]], prior: Prior, noise: Noise = USUAL) -> Calibration:
    """The parameters of a person from windows (trial, window), all of them used.

    Where the residual is larger than its noise, the floor is raised until it is not: what no chain follows widens the bands.
    """
    pick = np.linspace(0, len(windows) - 1, min(len(windows), MOST)).astype(int)
    chosen = [windows[i] for i in pick.tolist()]
    directions = np.array([w.directions for _, w in chosen])

    def solved(floor: float) -> tuple[Posterior, Rows, Array]:
        rows, constant = _rows(chosen, prior, replace(noise, floor=floor), directions)
        return model.batch(prior, rows), rows, constant

    floor = noise.floor
    if chosen and solved(floor)[0].misfit > 1.0:
        floor = (
            COARSEST if solved(COARSEST)[0].misfit > 1.0 else float(brentq(lambda f: solved(f)[0].misfit - 1.0, floor, COARSEST, rtol=0.02))
        )
    posterior, rows, constant = solved(floor)
    return Calibration(posterior, rows, constant, replace(noise, floor=floor), directions)


def _rows(chosen: Sequence[tuple[str, Window]], prior: Prior, noise: Noise, directions: Array) -> tuple[Rows, Array]:
    """Rows of both horizontal axes, decorrelated; and what a constant error of the CoP does to them."""
    q, k = len(prior.mean), len(chosen)
    if not chosen:
        return Rows(np.zeros((0, q)), np.zeros(0)), np.zeros((0, 2))
    covariance = model.floor_covariance(turned(directions), noise)
    trials = np.array([trial for trial, _ in chosen])
    for trial in np.unique(trials):
        mine = np.flatnonzero(trials == trial)
        at, n = np.array([chosen[i][1].middle for i in mine]), chosen[mine[0]][1].samples
        length = float(np.min(np.diff(at))) if len(at) > 1 else 1.0
        covariance[np.ix_(mine, mine)] += model.mean_covariance(at, length, n, noise)
    axes = []
    for a in (0, 1):
        h = np.column_stack([np.array([w.basis[a] for _, w in chosen]), np.ones(k)])
        y = np.array([w.ground[a] - w.table[a] for _, w in chosen])
        axes.append(model.decorrelated(h, y, covariance))
    zero = np.zeros(k)
    constant = np.column_stack([np.concatenate([axes[0].matrix[:, -1], zero]), np.concatenate([zero, axes[1].matrix[:, -1]])])
    return Rows(np.vstack([r.matrix[:, :-1] for r in axes]), np.concatenate([r.values for r in axes])), constant


# -- a subject --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Trial:
    """A trial of a subject: its key, columns in all frames, and windows."""

    key: dict[str, str]
    time: Array
    columns: Columns
    windows: list[Window]


@dataclass(frozen=True)
class Person:
    """A subject's own CoM.  calibration: from all used windows.  heldout: of each used window, its CoM told by the others (3,)."""

    subject: str
    trials: list[Trial]
    parameters: tuple[Parameter, ...]
    calibration: Calibration
    heldout: dict[tuple[str, float], Array]

    def com(self, c: Columns) -> tuple[Array, Array]:
        """CoM and its predicted sd in the frames of a trial [m], each (n, 3); what no chain follows is in the sd."""
        p = self.calibration.posterior
        sd = np.hypot(model.spread(c.basis, p.covariance), self.calibration.noise.floor)
        return np.asarray(c.table + c.basis @ p.mean), np.asarray(sd)


def person(subject: str, trials: Sequence[Trial], wanted: Sequence[str], times: float, noise: Noise = USUAL) -> Person | None:
    """The own CoM of one subject; None where no trial has a CoM from markers.

    wanted: tasks or trials whose still windows calibrate; empty: all.  times: the prior's spread over the published one [1].
    Trials in which other segments are seen than in most do not calibrate: their parameters mean something else.
    """
    by_set = Counter(tuple(p.name for p in t.columns.parameters) for t in trials if len(t.columns.parameters))
    if not by_set:
        return None
    usual = by_set.most_common(1)[0][0]
    alike = [t for t in trials if tuple(p.name for p in t.columns.parameters) == usual]
    used = [t for t in alike if not wanted or {t.key["trial"], t.key["task"]} & set(wanted)]
    windows = [(t.key["trial"], w) for t in used for w in t.windows if not w.reason]
    prior = alike[0].columns.prior(times)
    whole = calibrate(windows, prior, noise)
    return Person(subject, alike, alike[0].columns.parameters, whole, dict(_heldout(windows, prior, whole.noise)))


def _heldout(windows: Sequence[tuple[str, Window]], prior: Prior, noise: Noise) -> Iterator[tuple[tuple[str, float], Array]]:
    """CoM of each window told by windows of other trials (of other quarters of it where there is but one), by trial and time."""
    trials = sorted({trial for trial, _ in windows})
    fold = {trial: i % FOLDS for i, trial in enumerate(trials)}
    group = [fold[trial] if len(trials) > 1 else QUARTERS * i // len(windows) for i, (trial, _) in enumerate(windows)]
    for g in sorted(set(group)):
        rest = [w for w, k in zip(windows, group, strict=True) if k != g]
        mean = calibrate(rest, prior, noise).posterior.mean if rest else prior.mean
        for (trial, w), k in zip(windows, group, strict=True):
            if k == g:
                yield (trial, w.middle), w.table + w.basis @ mean
