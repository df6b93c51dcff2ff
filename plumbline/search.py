"""Regressions over sets of effects from sums of products, and the search for the set that predicts trials left out."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from plumbline.evidence import Weak
from plumbline.fit import BOTH, TEST, TRAIN

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

FOLDS = 8
CLUSTERS = 6  # trials from which on they are what is independent
BASE = ("=kinematic", "=moment", "=vertical", "=h")
"""Columns of every model: a constant in each equation, and h = 1/w2 [s2]."""


@dataclass(frozen=True)
class Sums:
    """Sums of products of one subject and axis, per independent piece and equation.

    equations: their names.  columns: (effect, number) of each of the P columns, base first.  gram (E, C, P, P), right (E, C, P),
    square (E, C), count (E, C): over the windows of piece c in equation e.  trial: index of each piece's trial, (C,).  trials: their ids.
    floor: variance that sensor noise gives, (E, C).  w2, h: with which the columns were made [1/s2], [s2].
    train, test: pieces that models are fitted on, that they are judged on, (C,); the same, and all, where folds are left out.
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
    train: Mask
    test: Mask

    def of(self, effects: Iterable[str]) -> Index:
        """Columns of the base and of some effects."""
        wanted = {*BASE, *effects}
        return np.flatnonzero([name in wanted for name, _ in self.columns])

    def splits(self) -> Iterator[tuple[Mask, Mask]]:
        """Pieces to fit on and pieces to judge on: whole trials left out in folds, or once as the config asks."""
        if not (self.train.all() and self.test.all()):
            yield self.train, self.test
            return
        fold = self.trial % min(FOLDS, len(self.trials))
        yield from ((fold != f, fold == f) for f in np.unique(fold))

    @property
    def judged(self) -> Array:
        """Windows of each equation that models are judged on, (E,)."""
        return np.asarray(self.count[:, self.test].sum(1))

    @property
    def clusters(self) -> Index:
        """What is independent of each other: trials; pieces where there are fewer than six trials, (C,)."""
        return self.trial if len(self.trials) >= CLUSTERS else np.arange(len(self.trial))

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
    train, test = (np.array([w.use in (side, BOTH) for _, w, _ in pieces]) for side in (TRAIN, TEST))
    return Sums(equations, tuple(columns), out["gram"], out["right"], square, count, trial, names, floor, w2, mass, h, train, test)


def on_disk(s: Sums, folder: Path) -> Sums:
    """The same with its large arrays in files of a new folder, from where they are read as they are needed."""
    folder.mkdir()
    names = ("gram", "right")
    for name in names:
        np.save(folder / name, getattr(s, name))
    return replace(s, **{name: np.load(folder / f"{name}.npy", mmap_mode="r") for name in names})


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
    """Sum of squares of each set, equation and piece on trials left out, (S, E, C); 0 for pieces that are not judged.

    weight: of each equation (E,), 0 for those that are only looked at.  sets: columns of each model.  silent: columns that are fitted
    but whose part stays in the residual.
    """
    gram = np.einsum("e,ecij->cij", weight, s.gram)
    right = np.einsum("e,eci->ci", weight, s.right)
    out = np.zeros((len(sets), len(s.equations), len(s.trial)))
    by_size: dict[int, list[int]] = {}
    for k, columns in enumerate(sets):
        by_size.setdefault(len(columns), []).append(k)
    for rest, mine in s.splits():
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
    """Coefficients of some columns, their covariance (jackknife over `Sums.clusters`), and the number of its clusters."""

    columns: Index
    theta: Array
    covariance: Array
    clusters: int

    def of(self, s: Sums, effect: str) -> tuple[Array, Array]:
        """Coefficients of an effect and their covariance."""
        here = [k for k, c in enumerate(self.columns) if s.columns[c][0] == effect]
        return self.theta[here], self.covariance[np.ix_(here, here)]

    def chance(self, s: Sums, effect: str) -> float:
        """p of no such effect: Wald's F over the clusters (Hotelling), of all its coefficients together."""
        theta, covariance = self.of(s, effect)
        k, rest = len(theta), self.clusters - len(theta)
        if rest < 1 or not k:
            return 1.0
        size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        z = theta / size
        wald = float(z @ np.linalg.pinv(covariance / np.outer(size, size), rcond=1e-9, hermitian=True) @ z)
        return float(fdtrc(k, rest, wald * rest / (k * (self.clusters - 1))))


def fit(s: Sums, weight: Array, columns: Index, *, among: NDArray[np.bool_] | None = None, known: Mapping[int, float] | None = None) -> Fit:
    """Weighted least squares.  among: pieces used (mask), None for all.  known: column -> coefficient that is not fitted."""
    if known:
        return _with_known(s, weight, columns, among, known)
    use = s.train if among is None else among
    gram = np.einsum("e,ecij->cij", weight, s.gram[:, use][:, :, columns[:, None], columns])
    right = np.einsum("e,eci->ci", weight, s.right[:, use][:, :, columns])
    label = s.clusters[use]
    groups = np.unique(label)
    g, r = gram.sum(0), right.sum(0)
    theta = solve(g, r)
    if len(groups) < 2:
        return Fit(columns, theta, np.full(g.shape, np.inf), len(groups))
    # whole clusters left out: with few of them the sandwich of their scores comes out too small
    without = np.stack([solve(g - gram[label == k].sum(0), r - right[label == k].sum(0)) - theta for k in groups])
    return Fit(columns, theta, (len(groups) - 1) / len(groups) * without.T @ without, len(groups))


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
    theta = fit(s, weight, columns, among=s.train | s.test).theta
    return np.asarray(np.maximum(s.error(theta, columns).sum(1), 0.0) / np.maximum(s.count.sum(1), 1))


def subsets(names: Sequence[str], most: int, apart: Mapping[str, set[str]]) -> list[tuple[str, ...]]:
    """Sets of at most `most` names, none with two that look the same (`apart`: name -> its twins)."""
    out: list[tuple[str, ...]] = [()]
    for size in range(1, most + 1):
        out += [c for c in combinations(names, size) if not any(b in apart.get(a, ()) for a, b in combinations(c, 2))]
    return out
