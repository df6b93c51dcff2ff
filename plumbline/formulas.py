r"""What a residual looks like that no effect explains: a term like ..., found by sparse regression, never a named cause.

The residual of a plant equation is a bump mean, so every candidate is the bump mean of a function of the channels (weak form, no
channel is differentiated twice): powers of x, v, p, edges, places, rubbing, memory, rhythms. PySINDy's forward orthogonal regression
(FROLS, de Silva 2020) is run on trials drawn with replacement; what it picks is judged on trials left out. The columns that were
fitted before the residual was taken are projected out of both sides (Frisch and Waugh 1933), else a term would be judged by what
they left of it.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from plumbline.evidence import Weak, split
from plumbline.library import Library, cost, fits, line
from plumbline.search import FOLDS, design

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Support = tuple[int, ...]

UNITS = {"kinematic": "m/s2", "vertical": "m/s2", "moment": "m", "whole": "m"}
ABSORBED = 0.02  # [1] share of a candidate's variance that the fitted columns must leave, else it cannot be told from them
TERMS = 3  # longest formula
MEMBERS = 20  # of the ensemble
WORTH = 0.08  # [1] of the variance left that a further term must take on trials left out
SPARED = 0.08  # [1] of the residual's variance below which detail does not count
KEPT = 0.1  # [1] of the variance that a formula must take on trials left out to be told at all
ALONE = 0.9  # [1] share of a candidate's sum of squares that one trial may hold
RHYTHMS = (0.15, 3.0)  # [Hz] slowest and fastest rhythm that is looked for


@dataclass(frozen=True)
class Formula:
    """What the residual looks like.

    text: in words.  names, coefficients: of its terms, in the equation's unit.  kept: share of the ensemble that keeps each.
    share: of the residual's variance on trials left out.  r: correlation with the residual.  values: of each trial, (n,).
    """

    text: str
    names: tuple[str, ...]
    coefficients: tuple[float, ...]
    kept: tuple[float, ...]
    share: float
    r: float
    values: tuple[Array, ...]


# -- what is left ------------------------------------------------------------------------------------------------------


def remains(windows: Sequence[Weak], effects: Sequence[str], w2: float, equation: str, h: float = 0.0) -> tuple[list[Array], list[Array]]:
    """Residual of an equation after some effects, (n,) of each trial, and the columns that were fitted, (n, q).

    windows: of one subject and axis.  w2: (z'' + g)/z [1/s2].  h: lever per acceleration [s2], 1/w2 where not given. The equation
    is fitted by itself.
    """
    made = [design(w, equation, effects, w2, h or 1.0 / w2) for w in windows]
    columns = np.concatenate([a for a, _ in made])
    used = np.flatnonzero(np.any(columns != 0, axis=0))
    a, y = columns[:, used], np.concatenate([b for _, b in made])
    left = y - a @ _coefficients(a, y)
    return split(left, windows), split(a, windows)


def _coefficients(a: Array, y: Array) -> Array:
    """Least squares, columns scaled to one; twins share."""
    scale = np.sqrt(np.mean(a**2, axis=0)) + 1e-300
    solved = np.linalg.lstsq(a / scale, y, rcond=1e-10)[0]
    return np.asarray((solved.T / scale).T)


def projected(values: Array, windows: Sequence[Weak], beside: Sequence[Array] | None) -> Array:
    """What is left of columns (N, K) when each subject's constant and fitted columns are taken out of them."""
    out = np.array(values, float)
    subject = np.concatenate([np.full(len(w.time), w.subject, dtype=object) for w in windows])
    for one in dict.fromkeys(w.subject for w in windows):
        here = subject == one
        fitted = [b for w, b in zip(windows, beside, strict=True) if w.subject == one] if beside is not None else []
        a = np.column_stack([np.ones(here.sum()), *([np.concatenate(fitted)] if fitted else [])])
        out[here] -= a @ _coefficients(a, out[here])
    return out


def offered(windows: Sequence[Weak], terms: Library, equation: str, beside: Sequence[Array] | None) -> tuple[Index, Array]:
    """Terms that may stand in an equation and are not taken by what was fitted; and all (N, K) with that taken out.

    Where x - p stands on the left and p is fitted, x is what is left: a bent function of x or p would profit from its straight part,
    which belongs to a gain or a scale, so a line is taken out first.
    """
    raw = np.concatenate(terms.values)
    x = projected(raw, windows, None)
    for k, family in enumerate(terms.families):
        straight = line(family) if UNITS[equation] == "m" else ""
        if straight in terms.families:
            of = x[:, terms.families.index(straight)]
            x[:, k] = x[:, k] - of * float(x[:, k] @ of) / max(float(of @ of), 1e-300)
    bent = np.mean(x**2, axis=0)
    x = projected(x, windows, beside)
    variance = raw.var(axis=0)
    own = (np.mean(x**2, axis=0) > ABSORBED * bent) & (bent > ABSORBED**2 * variance) & (variance > 1e-20)
    return np.flatnonzero(own & np.array([fits(family, equation) for family in terms.families])), x


# -- rhythms -----------------------------------------------------------------------------------------------------------


def _rhythm(windows: Sequence[Weak], y: Array, beside: Sequence[Array] | None) -> tuple[str, Array]:
    """The strongest rhythm of a residual (N,), each trial with its own phase, and its values (N,).

    The phase at a third of a trial comes from the two others: else two free numbers a trial would explain any residual. What was
    fitted answers to the same rhythm, so phases are found beside it.
    """
    longest = max(max(float(np.ptp(w.time)) for w in windows), 1.0)
    coarse = np.arange(RHYTHMS[0], RHYTHMS[1], 1.0 / (4.0 * longest))
    power = np.zeros(len(coarse))
    for w, part in zip(windows, split(y, windows), strict=True):
        power += [float(part @ (q @ _coefficients(q, part))) for q in (_wave(w, f) for f in coarse)]
    fine = coarse[int(np.argmax(power))] + np.linspace(-3, 3, 25) / (8.0 * longest)
    waves = [projected(_waves(windows, f), windows, beside) for f in fine]
    best = int(np.argmax([float(y @ (q @ _coefficients(q, y))) for q in waves]))
    raw, third = _waves(windows, fine[best]), np.concatenate([np.arange(len(w.time)) * 3 // len(w.time) for w in windows])
    made = np.zeros(len(y))
    for k in range(3):
        phase = _coefficients(waves[best][third != k], y[third != k]).reshape(-1, 2)
        phase = phase / (np.hypot(*phase.T)[:, None] + 1e-300)
        made[third == k] = raw[third == k] @ phase.ravel()
    return f"sin(2 pi {fine[best]:.2f} t + a phase of each trial)", made


def _wave(w: Weak, frequency: float) -> Array:
    """Bump means of a sine and a cosine at the windows of a trial, (n, 2)."""
    f, turn = w.bump.value, 2 * np.pi * frequency
    gain = float(f @ np.cos(turn * np.arange(-w.bump.reach, w.bump.reach + 1) / w.bump.rate))
    return gain * np.column_stack([np.sin(turn * w.time), np.cos(turn * w.time)])


def _waves(windows: Sequence[Weak], frequency: float) -> Array:
    """Sine and cosine of each trial, zero elsewhere, (N, 2 trials)."""
    return np.asarray(block_diag(*[_wave(w, frequency) for w in windows]))


# -- formulas ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Search:
    """K candidates: names and costs; values (N, K) raw and with what was fitted taken out; the residual likewise, (N,); folds, (N,)."""

    names: Sequence[str]
    costs: Array
    raw: Array
    x: Array
    y: Array
    folds: Index

    def charge(self, support: Support) -> float:
        """What its terms cost, in log variance."""
        return WORTH * float(np.sum(self.costs[list(support)]))


def formulas(
    windows: Sequence[Weak], terms: Library, residual: Sequence[Array], equation: str, beside: Sequence[Array] | None = None, seed: int = 0
) -> list[Formula]:
    """The two best formulas of what an equation's residual looks like; none where nothing is predicted on trials left out.

    windows: of each trial.  terms: their candidates.  residual: (n,) of each.  equation: whole, moment, kinematic or vertical.
    beside: columns that were fitted before, (n, q) of each.  seed: of the ensemble. What is picked within a family (where an edge
    lies, how fast a rhythm is) is picked on all trials.
    """
    s = _candidates(windows, terms, residual, equation, beside)
    if not s.names or not np.any(s.y):
        return []
    met, chosen = _ensemble(s, np.random.default_rng(seed))
    share = {support: _left_out(s.x[:, support], s.y, s.folds) for support in met}
    order = sorted(met, key=lambda k: float(np.log(max(1.0 - share[k], 0.0) + SPARED)) + s.charge(k))
    picked = [k for k in order if share[k] > KEPT][:1]
    picked += [k for k in order if picked and not set(picked[0]) <= set(k) and share[k] > KEPT][:1]
    return [_formula(windows, s, k, share[k], chosen, equation) for k in picked]


def _candidates(
    windows: Sequence[Weak], terms: Library, residual: Sequence[Array], equation: str, beside: Sequence[Array] | None
) -> _Search:
    """The best of each family that may stand in the equation, is not taken by what was fitted, and does not live in one trial only."""
    y = projected(np.concatenate(list(residual))[:, None], windows, beside)[:, 0]
    name, wave = _rhythm(windows, y, beside)
    parts = tuple(np.column_stack([a, b]) for a, b in zip(terms.values, split(wave, windows), strict=True))
    terms = Library((*terms.names, name), (*terms.families, "rhythm"), parts)
    raw, names, families = np.concatenate(terms.values), terms.names, terms.families
    usable, x = offered(windows, terms, equation, beside)
    square = np.maximum(np.sum(x**2, axis=0), 1e-300)
    crowded = (np.max([np.sum(part**2, axis=0) for part in split(x, windows)], axis=0) > ALONE * square) & (len(windows) >= 3)
    r = np.abs(x.T @ y) / np.maximum(np.sqrt(square) * np.linalg.norm(y), 1e-300)
    best: dict[str, int] = {}
    for k in usable[~crowded[usable]]:
        if r[k] > r[best.get(families[k], k)] - (families[k] not in best):
            best[families[k]] = int(k)
    here = _distinct(x, sorted(best.values(), key=lambda k: -r[k]))
    return _Search([names[k] for k in here], np.array([cost(families[k]) for k in here]), raw[:, here], x[:, here], y, _folds(windows))


def _distinct(x: Array, order: Sequence[int]) -> list[int]:
    """Columns without those that look the same as one before (0.9999)."""
    unit = x / np.maximum(np.linalg.norm(x, axis=0), 1e-300)
    out: list[int] = []
    for k in order:
        if not out or np.max(np.abs(unit[:, out].T @ unit[:, k])) < 0.9999:
            out.append(k)
    return out


def _folds(windows: Sequence[Weak]) -> Index:
    """Fold of each window: whole trials; pieces where there are fewer than three trials."""
    if len(windows) >= 3:
        return np.repeat(np.arange(len(windows)) % FOLDS, [len(w.time) for w in windows])
    pieces = [k * 1000 + w.cluster for k, w in enumerate(windows)]
    return np.asarray(np.unique(np.concatenate(pieces), return_inverse=True)[1] % FOLDS)


def _left_out(x: Array, y: Array, folds: Index) -> float:
    """Share of the variance of y that columns explain on folds left out."""
    error = 0.0
    for f in np.unique(folds):
        mine = folds == f
        error += float(np.sum((y[mine] - x[mine] @ _coefficients(x[~mine], y[~mine])) ** 2))
    return 1.0 - error / float(y @ y)


def _ensemble(s: _Search, rng: np.random.Generator) -> tuple[list[Support], list[Support]]:
    """Supports met on the way of any member, single terms among them, and the one that each member wants: by trials it did not draw."""
    labels = np.unique(s.folds)
    x, y = s.x / np.sqrt(np.mean(s.x**2, axis=0)), s.y / np.sqrt(np.mean(s.y**2))
    single = [(k,) for k in range(len(s.names))]
    met: set[Support] = set(single)
    chosen = []
    for _ in range(MEMBERS):
        drawn = rng.choice(labels, len(labels))
        rows = np.concatenate([np.flatnonzero(s.folds == k) for k in drawn])
        rest = ~np.isin(s.folds, drawn)
        rest = rest if rest.any() else np.ones(len(y), bool)
        path = _path(x[rows], y[rows]) + single
        met |= set(path)
        errors = np.array([float(np.mean((y[rest] - x[rest][:, k] @ _coefficients(x[rows][:, k], y[rows])) ** 2)) for k in path])
        chosen.append(path[int(np.argmin(np.log(errors + SPARED) + np.array([s.charge(k) for k in path])))])
    return sorted(met), chosen


def _path(x: Array, y: Array) -> list[Support]:
    """Supports of one to TERMS terms, by PySINDy's forward orthogonal regression.

    Its own choice among them (`coef_`) takes the least error REDUCTION in place of the least error, and its ensemble draws samples,
    which overlap here: both are done outside. Its path lags one behind: entry k has k terms.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pysindy.optimizers import FROLS  # slow to import (2 s), and only wanted where something is left

        found = FROLS(max_iter=TERMS, alpha=1e-9, unbias=False).fit(x, y[:, None]) if x.shape[1] > TERMS else None
    path = [tuple(np.flatnonzero(step[0]).tolist()) for step in found.history_] if found is not None else []
    return list(dict.fromkeys(k for k in path if k))


def _formula(windows: Sequence[Weak], s: _Search, support: Support, share: float, chosen: Sequence[Support], equation: str) -> Formula:
    """One formula in words and numbers."""
    theta = _coefficients(s.x[:, support], s.y)
    kept = tuple(float(np.mean([k in c for c in chosen])) for k in support)
    made = s.x[:, support] @ theta
    r = float(made @ s.y) / max(float(np.linalg.norm(made) * np.linalg.norm(s.y)), 1e-300)
    told = " ".join(f"{c:+.3g} {s.names[k]}" for c, k in zip(theta, support, strict=True))
    text = f"a term like {told} [{UNITS[equation]}], {share:.0%} of the variance on trials left out, no known effect"
    values = tuple(split(s.raw[:, support] @ theta, windows))
    return Formula(text, tuple(s.names[k] for k in support), tuple(theta.tolist()), kept, share, r, values)
