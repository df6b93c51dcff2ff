"""Regressions over sets of effects from sums of products, and the search for the set that predicts trials left out."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from plumbline.evidence import Weak

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FOLDS = 8
BASE = ("=kinematic", "=moment", "=vertical", "=h")
"""Columns of every model: a constant in each equation, and h = 1/w2 [s2]."""


@dataclass(frozen=True)
class Sums:
    """Sums of products of one subject and axis, per independent piece and equation.

    equations: their names.  columns: (effect, number) of each of the P columns, base first.  gram (E, C, P, P), right (E, C, P),
    square (E, C), count (E, C): over the windows of piece c in equation e.  trial: index of each piece's trial, (C,).  trials: their ids.
    floor: variance that sensor noise gives, (E, C).  w2, h: with which the columns were made [1/s2], [s2].
    """

    equations: tuple[str, ...]
    columns: tuple[tuple[str, int], ...]
    gram: Array
    right: Array
    square: Array
    count: Array
    trial: Index
    trials: tuple[str, ...]
    floor: Array
    w2: float
    mass: float
    h: float

    def of(self, effects: Iterable[str]) -> Index:
        """Columns of the base and of some effects."""
        wanted = {*BASE, *effects}
        return np.flatnonzero([name in wanted for name, _ in self.columns])

    @property
    def folds(self) -> Index:
        """Fold of each piece: whole trials."""
        return self.trial % min(FOLDS, len(self.trials))

    def error(self, theta: Array, columns: Index, pieces: Array | slice = slice(None)) -> Array:
        """Sum of squares of each equation over some pieces, (E, c), at coefficients of some columns."""
        g = self.gram[:, pieces][:, :, columns[:, None], columns]
        r = self.right[:, pieces][:, :, columns]
        return np.asarray(self.square[:, pieces] - 2 * r @ theta + np.einsum("ecij,i,j->ec", g, theta, theta))


def sums(windows: Sequence[Weak], effects: Sequence[str], w2: float, h: float = 0.0) -> Sums:
    """Sums of one subject and axis.  effects: those offered; a trial that lacks a term of one has it dropped by the caller.

    w2: (z'' + g)/z [1/s2].  h: lever per acceleration of the body [s2], 1/w2 where not given: legs that lean under an upright trunk make it
    a tenth larger, and a force that is missing in Fx goes with it.
    """
    h = h or 1.0 / w2
    shear = all(np.isfinite(w.force).all() for w in windows)
    upright = ("vertical",) if all(np.isfinite(w.vertical).all() for w in windows) else ()
    equations = ("kinematic", "moment", *upright, "whole") if shear else ("whole",)
    columns = [(name, 0) for name in BASE]
    first = windows[0].terms
    columns += [(name, k) for name in effects for k in range(first[name]["plain"].shape[1])]
    pieces = [(i, w, c) for i, w in enumerate(windows) for c in np.unique(w.cluster)]
    size, number, many = len(columns), len(equations), len(pieces)
    out = {"gram": np.zeros((number, many, size, size)), "right": np.zeros((number, many, size))}
    square, count, floor = (np.zeros((number, many)) for _ in range(3))
    at = 0
    for w in windows:
        for e, equation in enumerate(equations):
            x, y = design(w, equation, effects, w2, h)
            z = np.column_stack([x, y])
            noise = w.floor(equation, h)
            for k, c in enumerate(np.unique(w.cluster)):
                part = z[w.cluster == c]
                products = part.T @ part
                out["gram"][e, at + k], out["right"][e, at + k] = products[:-1, :-1], products[:-1, -1]
                square[e, at + k], count[e, at + k], floor[e, at + k] = products[-1, -1], len(part), noise
        at += len(np.unique(w.cluster))
    trial = np.array([i for i, _, _ in pieces])
    names = tuple(w.trial for w in windows)
    mass = float(np.mean([w.mass for w in windows]))
    return Sums(equations, tuple(columns), out["gram"], out["right"], square, count, trial, names, floor, w2, mass, h)


def design(w: Weak, equation: str, effects: Sequence[str], w2: float, h: float) -> tuple[Array, Array]:
    """Columns (n, P) and left side (n,) of an equation; kinematic and vertical in m/s2, moment and whole in m.

    What was taken out of the channels before the windows were made is given back to first order: coefficients are of the whole effect.
    """
    n = len(w.time)
    base = np.zeros((n, 4))
    if equation == "kinematic":
        base[:, 0] = 1.0
        left = w.acceleration - w.force
    elif equation == "vertical":
        base[:, 2] = 1.0
        left = w.vertical
    else:
        # a force that the plates miss stands in x'' but not in the moment
        base[:, 0] = -h if equation == "whole" and np.isfinite(w.force).all() else 0.0
        base[:, 1] = 1.0
        base[:, 3] = w.force if equation == "moment" else w.acceleration
        left = w.lever
    for name, theta in w.centre.items():
        left = left + _part(w, equation, name, w2, h) @ theta
    return np.column_stack([base, *(_part(w, equation, name, w2, h) for name in effects)]), left


def _part(w: Weak, equation: str, name: str, w2: float, h: float) -> Array:
    """Columns of one effect in an equation, (n, k)."""
    terms = w.terms[name]
    if equation in ("kinematic", "vertical"):
        return terms["force" if equation == "kinematic" else "vertical"]
    out = -terms["plain"] / w2 - terms["by_w2"]
    return out + h * terms["force"] if equation == "moment" else out


# -- fits -------------------------------------------------------------------------------------------------------------


def solve(gram: Array, right: Array) -> Array:
    """Solutions of many normal equations, (..., s, s) and (..., s); columns scaled to one, a ridge of 1e-9 against exact twins."""
    scale = np.sqrt(np.einsum("...ii->...i", gram))
    scale = np.where(scale > 0, scale, 1.0)
    g = gram / scale[..., :, None] / scale[..., None, :]
    g = g + 1e-9 * np.eye(gram.shape[-1])
    return np.asarray(np.linalg.solve(g, (right / scale)[..., None])[..., 0] / scale)


def heldout(s: Sums, weight: Array, sets: Sequence[Index], silent: Index | None = None) -> Array:
    """Sum of squares of each set, equation and piece on folds left out, (S, E, C).

    weight: of each equation (E,), 0 for those that are only looked at.  sets: columns of each model.  silent: columns that are fitted
    but whose part stays in the residual.
    """
    fold = s.folds
    gram = np.einsum("e,ecij->cij", weight, s.gram)
    right = np.einsum("e,eci->ci", weight, s.right)
    out = np.empty((len(sets), len(s.equations), len(s.trial)))
    by_size: dict[int, list[int]] = {}
    for k, columns in enumerate(sets):
        by_size.setdefault(len(columns), []).append(k)
    for f in np.unique(fold):
        mine, rest = fold == f, fold != f
        g, r = gram[rest].sum(0), right[rest].sum(0)
        test_g, test_r = s.gram[:, mine], s.right[:, mine]
        for members in by_size.values():
            chosen = np.array([sets[k] for k in members])
            theta = solve(g[chosen[:, :, None], chosen[:, None, :]], r[chosen])
            full = np.zeros((len(members), len(s.columns)))
            np.put_along_axis(full, chosen, theta, 1)
            if silent is not None:
                full[:, silent] = 0.0
            cross = np.einsum("eci,ki->kec", test_r, full)
            power = np.einsum("ki,ecij,kj->kec", full, test_g, full, optimize=True)
            out[np.ix_(np.array(members), np.arange(len(s.equations)), np.flatnonzero(mine))] = s.square[None, :, mine] - 2 * cross + power
    return out


@dataclass(frozen=True)
class Fit:
    """Coefficients of some columns over all pieces, their covariance clustered by trial (by piece below six trials), and its clusters."""

    columns: Index
    theta: Array
    covariance: Array
    clusters: int

    def of(self, s: Sums, effect: str) -> tuple[Array, Array]:
        """Coefficients of an effect and their covariance."""
        here = [k for k, c in enumerate(self.columns) if s.columns[c][0] == effect]
        return self.theta[here], self.covariance[np.ix_(here, here)]


def fit(s: Sums, weight: Array, columns: Index, *, among: NDArray[np.bool_] | None = None, known: Mapping[int, float] | None = None) -> Fit:
    """Weighted least squares.  among: pieces used (mask), None for all.  known: column -> coefficient that is not fitted."""
    if known:
        return _with_known(s, weight, columns, among, known)
    use = np.ones(len(s.trial), bool) if among is None else among
    gram = np.einsum("e,ecij->cij", weight, s.gram[:, use][:, :, columns[:, None], columns])
    right = np.einsum("e,eci->ci", weight, s.right[:, use][:, :, columns])
    theta = solve(gram.sum(0), right.sum(0))
    scores = right - gram @ theta
    label = s.trial[use] if len(s.trials) >= 6 else np.flatnonzero(use)
    groups = np.unique(label)
    by_group = np.stack([scores[label == k].sum(0) for k in groups])
    bread = np.linalg.pinv(gram.sum(0), rcond=1e-14, hermitian=True)
    factor = len(groups) / max(len(groups) - 1, 1)
    return Fit(columns, theta, factor * bread @ (by_group.T @ by_group) @ bread, len(groups))


def _with_known(s: Sums, weight: Array, columns: Index, among: NDArray[np.bool_] | None, known: Mapping[int, float]) -> Fit:
    """A fit with some coefficients given, their part taken to the left side."""
    given = np.array(list(known), int)
    right = s.right - s.gram[..., given] @ np.array(list(known.values()))
    got = fit(replace(s, right=right), weight, np.setdiff1d(columns, given), among=among)
    theta = np.array([known[c] if c in known else got.theta[np.searchsorted(got.columns, c)] for c in columns])
    covariance = np.zeros((len(columns), len(columns)))
    free = np.flatnonzero(~np.isin(columns, given))
    covariance[np.ix_(free, free)] = got.covariance
    return Fit(columns, theta, covariance, got.clusters)


def residual_variance(s: Sums, weight: Array, columns: Index) -> Array:
    """Variance of each equation at the fit over all pieces, (E,)."""
    theta = fit(s, weight, columns).theta
    return np.asarray(np.maximum(s.error(theta, columns).sum(1), 0.0) / np.maximum(s.count.sum(1), 1))


def subsets(names: Sequence[str], most: int, apart: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    """Sets of at most `most` names, none with two that look the same (`apart`: name -> its twins)."""
    out: list[tuple[str, ...]] = [()]
    for size in range(1, most + 1):
        out += [c for c in combinations(names, size) if not any(b in apart.get(a, ()) for a, b in combinations(c, 2))]
    return out
