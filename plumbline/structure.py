r"""Is anything left in a residual? Its memory, and what it follows: the state, channels that no effect used, time and trial.

Windows overlap and are bump means, so sensor noise alone makes neighbours alike: what is independent are blocks somewhat longer than
the support of the bump. Noise has no sign: flipping the sign of whole blocks gives what a correlation with a channel may be by
chance, and the largest over all channels gives a p-value that counts how many were looked at (Westfall & Young 1993). Beyond the
support of the bump white noise has no memory at all. With many blocks very little is significant, and every body is a little softer
than its model: what is found must also be as large as a share of the noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from plumbline.evidence import Weak, split
from plumbline.formulas import offered, projected
from plumbline.library import Library

Array = NDArray[np.float64]
Index = NDArray[np.int64]

FLIPS = 4000  # of the signs of blocks
SURE = 0.005  # [1] p below which a residual follows something: some ten tests make a verdict
LARGE = 0.65  # [1] of the noise that the rms of what it follows must reach, and the whole residual beyond the noise
OVER = 1.5  # [1] residual over noise that is too much, whatever it follows
BLOCK = 1.5  # supports of the bump that make an independent block

WORDS = {
    "x": "the place of the CoM", "x^2": "the square of the CoM's place", "x^3": "the cube of the CoM's place",
    "|x| x": "the CoM's place, more than in proportion", "v": "the velocity", "v^2": "the square of the velocity",
    "v^3": "the cube of the velocity", "|v| v": "the velocity, more than in proportion", "x v": "place times velocity",
    "p": "the ZMP", "p^2": "the square of the ZMP", "p^3": "the cube of the ZMP", "|p| p": "the ZMP, more than in proportion",
    "t": "the time in the trial", "com_z": "the height of the CoM", "com_y": "the CoM along the other axis",
    "com_y_dot": "the velocity along the other axis", "ang_mom": "the angular momentum", "ang_mom_dot": "the rate of angular momentum",
    "grf_y": "the force along the other axis", "grf_z": "the load on the plates", "memory": "where the ZMP was before",
    "trial": "the trial", "itself": "its own past",
}  # fmt: skip
"""Families of the library that are tried, in words, with the two tests that need no channel."""


@dataclass(frozen=True)
class Structure:
    """What a residual follows.

    left: whether anything is.  p: of each thing tried, counted for the number of channels.  r: correlation with each channel; share of
    the variance that lies between trials; autocorrelation beyond the bump.  size: rms of that part over the noise.  text: in words.
    """

    left: bool
    p: Mapping[str, float]
    r: Mapping[str, float]
    size: Mapping[str, float]
    text: str


def structure(
    windows: Sequence[Weak], terms: Library, residual: Sequence[Array], equation: str, usual: float,
    beside: Sequence[Array] | None = None, seed: int = 0,
) -> Structure:  # fmt: skip
    """Ask what is left of one equation.

    windows: of each trial.  terms: their library.  residual: (n,) of each.  equation: its name.  usual: rms that noise and a model's
    usual faults give, in the residual's unit; NaN where not known, and nothing is decided.  beside: columns that were fitted before,
    (n, q) of each.  seed: of the flips.
    """
    rng = np.random.default_rng(seed)
    y = projected(np.concatenate(list(residual))[:, None], windows, beside)[:, 0]
    block = _blocks(windows)
    rms = float(np.sqrt(np.mean(y**2)))
    flips = rng.choice([-1.0, 1.0], (FLIPS, int(block.max()) + 1))
    p, r = _channels(windows, terms, y, equation, beside, block, flips)
    p["trial"], between = _between(windows, y, block, flips)
    p["itself"], memory = _memory(windows, y)
    size = {k: abs(v) * rms / usual for k, v in r.items()}
    size |= {"trial": between**0.5 * rms / usual, "itself": max(memory, 0.0) ** 0.5 * rms / usual}
    r |= {"trial": between, "itself": memory}
    beyond = np.sqrt(max((rms / usual) ** 2 - 1.0, 0.0))  # a channel that shares its noise with the residual follows it inside the noise
    found = [k for k in p if p[k] < SURE and min(size[k], beyond) > LARGE]
    return Structure(bool(found or rms > OVER * usual), p, r, size, _told(found, p, r, size, rms / usual))


def _told(found: Sequence[str], p: Mapping[str, float], r: Mapping[str, float], size: Mapping[str, float], over: float) -> str:
    if not found and over > OVER:
        return f"{over:.1f} times what noise and usual faults leave, and follows nothing that was measured for sure"
    if not found:
        return "what is left follows nothing that was measured, and has no memory"
    best = max(found, key=lambda k: size[k])
    chance = "p < 0.001" if p[best] < 0.001 else f"p = {p[best]:.3f}"
    if best == "trial":
        return f"the residual differs between trials: {r[best]:.0%} of its variance ({chance})"
    if best == "itself":
        return f"the residual follows its own past and no channel more closely ({chance})"
    return f"the residual follows {WORDS[best]}, r = {r[best]:.2f} ({chance})"


def _blocks(windows: Sequence[Weak]) -> Index:
    """Number of the independent block of each window, (N,): pieces cut into equal parts no shorter than BLOCK supports."""
    out, number = [], 0
    for w in windows:
        here = np.zeros(len(w.time), int)
        for c in np.unique(w.cluster):
            mine = w.cluster == c
            parts = max(int(np.ptp(w.time[mine]) / (BLOCK * 2 * w.bump.half_width)), 1)
            here[mine] = number + np.arange(mine.sum()) * parts // mine.sum()
            number += parts
        out.append(here)
    return np.concatenate(out)


def _channels(
    windows: Sequence[Weak], terms: Library, y: Array, equation: str, beside: Sequence[Array] | None, block: Index, flips: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """p-values over all channels and correlations of each."""
    usable, columns = offered(windows, terms, equation, beside)
    tried = [k for k in usable if terms.families[k] in WORDS]
    x, names = columns[:, tried], [terms.families[k] for k in tried]
    r = x.T @ y / np.maximum(np.linalg.norm(x, axis=0) * np.linalg.norm(y), 1e-300)
    scores = np.stack([_by_block(y, column, block) for column in x.T], axis=1)
    scale = np.sqrt(np.sum(scores**2, axis=0)) + 1e-300
    by_chance = np.max(np.abs(flips @ scores) / scale, axis=1)
    p = [(1 + np.sum(by_chance >= t - 1e-12)) / (1 + len(flips)) for t in np.abs(scores.sum(0)) / scale]
    best = {name: k for k, name in sorted(enumerate(names), key=lambda pair: abs(r[pair[0]]))}
    return {n: float(p[k]) for n, k in best.items()}, {n: float(r[k]) for n, k in best.items()}


def _by_block(y: Array, x: Array, block: Index) -> Array:
    """Score of each block, odd in y: the product, tempered so that a few far sways do not outvote all the rest."""
    size = np.bincount(block, y**2) * np.sqrt(np.bincount(block, x**2)) + 1e-300
    return np.asarray(np.bincount(block, y * x) / np.sqrt(size))


def _between(windows: Sequence[Weak], y: Array, block: Index, flips: Array) -> tuple[float, float]:
    """p-value of trials that differ in their mean, and the share of the variance between them."""
    counts = np.array([len(w.time) for w in windows], float)
    if len(windows) < 2:
        return 1.0, 0.0
    sums = np.bincount(block, y)
    trial = np.repeat(np.arange(len(windows)), counts.astype(int))
    of = np.zeros((len(sums), len(windows)))
    of[block, trial] = 1.0
    value = float(np.sum((sums @ of) ** 2 / counts))
    by_chance = np.sum(((flips * sums) @ of) ** 2 / counts, axis=1)
    return float((1 + np.sum(by_chance >= value - 1e-15)) / (1 + len(flips))), value / max(float(y @ y), 1e-300)


def _memory(windows: Sequence[Weak], y: Array) -> tuple[float, float]:
    """p-value and size of the mean product of windows one support of the bump apart, by piece: 0 for white noise."""
    found = []
    for w, part in zip(windows, split(y, windows), strict=True):
        for c in np.unique(w.cluster):
            t, v = w.time[w.cluster == c], part[w.cluster == c]
            lag = int(np.searchsorted(t, t[0] + 2 * w.bump.half_width))
            if len(v) > 1.5 * lag:
                found.append(float(np.mean(v[:-lag] * v[lag:])))
    if len(found) < 4:
        return 1.0, 0.0
    mean, sd = float(np.mean(found)), float(np.std(found, ddof=1))
    t = mean / (sd / np.sqrt(len(found)) + 1e-300)
    return float(stdtr(len(found) - 1, -t)), mean / max(float(np.mean(y**2)), 1e-300)
