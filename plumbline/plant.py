"""The plant equation of one trial in weak form: everything `fit` and `residuals` need, frame by frame.

Reads the UNFILTERED CoM, ZMP and force. A bump that meets a push (and a margin around it), a gap or an end gives NaN.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.models.com_zmp import Noise
from plumbline.physics import G
from plumbline.weak import SAMPLES, Bump, white_noise_sd

Array = NDArray[np.float64]

AXES = {"lateral": "x", "forward": "y"}
"""Name of each horizontal axis and the letter of its columns."""

PUSH_MARGIN = 0.08  # [s] hands touch before and leave after the marks
STRIDE = 0.05  # [s] between the centres of two test functions; they overlap, so clusters, not windows, carry the intervals
BLOCK = 5.0  # [s] longest stretch that counts as one independent piece: about a locus

SIGNALS = [
    "trial",
    "subject",
    "task",
    "condition",
    "frame",
    "time",
    "com_x",
    "com_y",
    "com_z",
    "zmp_x",
    "zmp_y",
    "zmp_z",
]
SIGNALS += ["grf_x", "grf_y", "grf_z"]
"""Columns of `signals` that the plant is judged on."""


@dataclass(frozen=True)
class Plant:
    """One trial, one axis. All arrays have shape (n,) over the frames; NaN where a bump does not fit.

    mean_x, mean_p, lever: bump means of x, p, x - p [m].  velocity [m/s].  acceleration: weak x'' [m/s2].
    force, vertical: rF and vertical residual [m/s2].  height: mean of z above the plates [m].
    cluster: number of the independent piece, -1 where masked.  noise: variance of the error from sensor noise at w2 -> function.
    """

    rate: float
    mean_x: Array
    mean_p: Array
    velocity: Array
    acceleration: Array
    force: Array
    vertical: Array
    height: float
    cluster: NDArray[np.int64]
    x: Array
    p: Array
    noise_x: float
    noise_p: float
    bump: Bump

    @property
    def lever(self) -> Array:
        """Bump mean of x - p [m]."""
        return self.mean_x - self.mean_p

    @property
    def picked(self) -> NDArray[np.int64]:
        """Frames at which a test function is judged: every STRIDE, where it is whole."""
        step = max(1, round(STRIDE * self.rate))
        index = np.arange(0, len(self.x), step)
        return index[np.isfinite(self.acceleration[index]) & np.isfinite(self.lever[index])]

    @property
    def rejected(self) -> int:
        """Test functions of the same grid that met a push, a gap or an end."""
        return len(range(0, len(self.x), max(1, round(STRIDE * self.rate)))) - len(self.picked)

    def noise_in_regression(self, count: int) -> Noise:
        """What sensor noise adds to the regression of x'' on x - p, for `count` windows; zeros where the noise is not known."""
        f, f2 = self.bump.value, self.bump.curvature
        x2, p2 = np.nan_to_num(self.noise_x) ** 2, np.nan_to_num(self.noise_p) ** 2
        return Noise(np.full(count, (x2 + p2) * (f @ f)), np.full(count, x2 * (f @ f2)))

    def w2_se(self, index: NDArray[np.int64], w2: float) -> float:
        """Standard error of w2 fitted, with a constant, to the test functions at `index`, from white sensor noise alone [1/s2].

        Test functions overlap: their errors are correlated as the autocorrelations of f'' - w2 f (x) and w2 f (p). NaN where the noise
        is not known. The scatter of two or three independent pieces would tell it no better than by a factor of two.
        """
        f, f2 = self.bump.value, self.bump.curvature
        lag = np.minimum(np.abs(index[:, None] - index[None]), len(f))
        both = ((self.noise_x, f2 - w2 * f), (self.noise_p, w2 * f))
        shared = sum(sd**2 * np.append(np.correlate(g, g, "full")[len(f) - 1 :], 0.0)[lag] for sd, g in both)
        a = np.column_stack([self.lever[index], np.ones(len(index))])
        bread = np.linalg.inv(a.T @ a)
        return float(np.sqrt((bread @ a.T @ shared @ a @ bread)[0, 0]))

    def noise_variance(self, w2: float) -> float:
        """Variance [m2] of the error (x - p) - x''/w2 that white sensor noise alone gives; NaN where the noise is not known."""
        f, f2 = self.bump.value, self.bump.curvature
        return float(self.noise_x**2 * np.sum((f - f2 / w2) ** 2) + self.noise_p**2 * np.sum(f**2))


def sampling_rate(time: Array) -> float:
    """Rate of uniformly sampled times [Hz]."""
    return float((len(time) - 1) / (time[-1] - time[0])) if len(time) > 1 else float("nan")


def plant(signals: pd.DataFrame, pushes: pd.DataFrame, mass: float, axis: str, bump: Bump, known_noise: bool) -> Plant:
    """Weak plant of one trial.

    signals: its rows of the table.  pushes: its rows.  mass [kg].  axis: lateral or forward.
    known_noise: False where the file was filtered before (its white noise cannot be told).
    """
    c = AXES[axis]
    time = signals["time"].to_numpy()
    masked = in_pushes(time, pushes)
    x = np.where(masked, np.nan, signals[f"com_{c}"])
    p = np.where(masked, np.nan, signals[f"zmp_{c}"])
    z = np.where(masked, np.nan, signals["com_z"] - np.nan_to_num(signals["zmp_z"]))
    fx, fz = (np.where(masked, np.nan, signals[f"grf_{k}"]) for k in (c, "z"))
    acceleration = bump.second(x)
    good = np.isfinite(x) & np.isfinite(p)
    return Plant(
        rate=bump.rate,
        mean_x=bump.mean(x),
        mean_p=bump.mean(p),
        velocity=bump.derivative(x),
        acceleration=acceleration,
        force=acceleration - bump.mean(fx) / mass,
        vertical=bump.second(z) + G - bump.mean(fz) / mass,
        height=float(np.nanmean(z)) if np.isfinite(z).any() else float("nan"),
        cluster=pieces(good, round(BLOCK * bump.rate)),
        x=x,
        p=p,
        noise_x=float(white_noise_sd(x)) if known_noise else float("nan"),
        noise_p=float(white_noise_sd(p)) if known_noise else float("nan"),
        bump=bump,
    )


def in_pushes(time: Array, pushes: pd.DataFrame) -> NDArray[np.bool_]:
    """True at the instants that lie in a push or within PUSH_MARGIN of it."""
    inside = np.zeros(len(time), bool)
    for start, end in zip(pushes["start"], pushes["end"], strict=True):
        inside |= (time >= start - PUSH_MARGIN - 1e-9) & (time <= end + PUSH_MARGIN + 1e-9)
    return inside


def pieces(good: NDArray[np.bool_], longest: int) -> NDArray[np.int64]:
    """Number the contiguous stretches of `good`, cut into equal blocks of at most `longest` frames; -1 elsewhere."""
    out = np.full(len(good), -1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.view(np.int8), [0]])))
    number = 0
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        parts = int(np.ceil((end - start) / longest))
        out[start:end] = number + np.arange(end - start) * parts // (end - start)
        number += parts
    return out


def rows_of(table: pd.DataFrame, rows: Any) -> pd.DataFrame:
    """Rows of a table; without a copy where they follow each other, as those of a trial do."""
    index = np.asarray(rows)
    if len(index) and index[-1] - index[0] + 1 == len(index):
        return table.iloc[int(index[0]) : int(index[-1]) + 1]
    return table.iloc[index]


def of_trials(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    coverage: pd.DataFrame,
    *,
    half_width: float,
    exponent: int,
    axes: Collection[str] = tuple(AXES),
) -> Iterator[tuple[pd.Series, pd.DataFrame, dict[str, Plant]]]:
    """The plants of every trial that has a CoM and a ZMP, one trial at a time.

    Yields the trial's row of `coverage`, its rows of `signals`, and axis -> Plant.
    """
    rows = signals.groupby("trial", sort=True, observed=True).indices
    by_trial = dict(tuple(pushes.groupby("trial", observed=True)))
    for _, about in coverage.sort_values("trial").iterrows():
        index = rows.get(about["trial"])
        if index is None or about["com_method"] == "none":
            continue
        frames = rows_of(signals, index)
        rate = sampling_rate(frames["time"].to_numpy())
        if not half_width * rate >= SAMPLES:
            continue
        bump = Bump(half_width, exponent, rate)
        pushed = by_trial.get(about["trial"], pushes.iloc[:0])
        known = not about["filtered_before"] and about["com_method"] != "force"
        plants = {a: plant(frames, pushed, about["mass"], a, bump, known) for a in axes}
        yield about, frames, {a: p for a, p in plants.items() if len(p.picked) >= 3}
