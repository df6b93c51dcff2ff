"""Identify the base model, x'' = w2 (x - p), and judge it on trials left out."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.models.com_zmp import Noise, PlantFit, fit, free_motion, zmp_error
from plumbline.physics import G
from plumbline.plant import AXES, Plant, of_trials, sampling_rate
from plumbline.study import names
from plumbline.tables import TABLES
from plumbline.weak import SAMPLES

Array = NDArray[np.float64]

FOLDS = 8


@dataclass(frozen=True)
class Windows:
    """The test functions of one trial and axis, with what groups them."""

    trial: str
    subject: str
    task: str
    condition: str
    axis: str
    plant: Plant
    time: Array
    locus: NDArray[np.int64]  # number of the locus at each frame, 0 outside
    names: frozenset[str] = frozenset()  # what the config may call the trial

    @property
    def picked(self) -> NDArray[np.int64]:
        """Frames at which the plant is judged."""
        return self.plant.picked


def identify(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    coverage: pd.DataFrame,
    evaluation: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `fit` and `heldout` of a part.

    signals, pushes, loci, coverage: tables of whole subjects (coverage may have the column `files` of `trials`, for names in the
    config).  evaluation: the config section.
    """
    everything = list(windows(signals, pushes, loci, coverage, evaluation))
    fits: list[dict[str, Any]] = []
    heldout: list[dict[str, Any]] = []
    for subject in sorted({w.subject for w in everything}):
        for axis in AXES:
            mine = [w for w in everything if w.subject == subject and w.axis == axis]
            fits += list(_fits(mine))
            heldout += list(judge(mine, evaluation))
    fits += list(_left_out(signals, coverage, everything, evaluation))
    return pd.DataFrame(fits), pd.DataFrame(heldout)


def windows(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    coverage: pd.DataFrame,
    evaluation: Mapping[str, Any],
    axes: Collection[str] = tuple(AXES),
) -> Iterator[Windows]:
    """The weak plant of every trial and axis."""
    settings: dict[str, Any] = {k: evaluation[k] for k in ("half_width", "exponent")} | {"axes": axes}
    for about, frames, plants in of_trials(signals, pushes, coverage, **settings):
        inside = locus_of_frames(frames, loci[loci["trial"] == about["trial"]])
        for axis, plant in plants.items():
            key = (about["trial"], about["subject"], about["task"], about["condition"])
            called = names(about["trial"], about["task"], str(about.get("files", "")).split(" + "))
            yield Windows(*key, axis, plant, frames["time"].to_numpy(), inside, frozenset(called))


def locus_of_frames(frames: pd.DataFrame, loci: pd.DataFrame) -> NDArray[np.int64]:
    """Number of the locus at each frame of a trial, 0 outside.  Frames number their trial from 0."""
    out = np.zeros(len(frames), int)
    number = frames["frame"].to_numpy()
    for locus, start, end in zip(loci["locus"], loci["start_frame"], loci["end_frame"], strict=True):
        out[(number >= start) & (number <= end)] = locus
    return out


# -- estimates --------------------------------------------------------------------------------------------------------


def _fits(mine: Sequence[Windows]) -> Iterator[dict[str, Any]]:
    """Rows of `fit` for one subject and axis: each locus, each condition of a task, everything."""
    for w in mine:
        for locus in np.unique(w.locus[w.locus > 0]):
            one = {"task": w.task, "condition": w.condition, "trial": w.trial, "locus": int(locus)}
            yield from _row([(w, w.picked[w.locus[w.picked] == locus])], "locus", one)
    for task, condition in sorted({(w.task, w.condition) for w in mine}):
        chosen = [(w, w.picked) for w in mine if (w.task, w.condition) == (task, condition)]
        yield from _row(chosen, "condition", {"task": task, "condition": condition, "trial": "", "locus": 0})
    yield from _row([(w, w.picked) for w in mine], "subject", {"task": "", "condition": "", "trial": "", "locus": 0})


def _left_out(
    signals: pd.DataFrame, coverage: pd.DataFrame, everything: Sequence[Windows], evaluation: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    """Rows of `fit` without an estimate, for trials with a CoM that hold no test function, with the reason."""
    blank = {c.name: {"str": "", "int": 0, "float": float("nan")}[c.kind] for c in TABLES["fit"]}
    seen = {(w.trial, w.axis) for w in everything}
    for _, about in coverage[coverage["com_method"] != "none"].iterrows():
        rate = sampling_rate(signals.loc[signals["trial"] == about["trial"], "time"].to_numpy())
        said = f"no test function of half width {evaluation['half_width']:g} s fits between its gaps, pushes and ends"
        if evaluation["half_width"] * rate < SAMPLES:
            said = f"{rate:.3g} Hz is too slow for a half width of {evaluation['half_width']:g} s"
        key = {k: about[k] for k in ("subject", "task", "condition", "trial")}
        for axis in AXES:
            if (about["trial"], axis) not in seen:
                yield blank | key | {"axis": axis, "level": "trial", "warning": f"{about['trial']}: {said}"}


def _row(chosen: Sequence[tuple[Windows, NDArray[np.int64]]], level: str, about: dict[str, Any]) -> Iterator[dict[str, Any]]:
    alone = level == "locus"
    got = solve(chosen, blocks=alone)
    if got is None:
        return
    low, high = got.omega_interval() if got.w2 > 0 else (float("nan"), float("nan"))
    height = np.average([w.plant.height for w, i in chosen], weights=[max(len(i), 1) for _, i in chosen])
    at_height = float(np.sqrt(G / height)) if height > 0 else float("nan")
    first = chosen[0][0]
    yield {
        **about, "subject": first.subject, "axis": first.axis, "level": level,
        "omega": got.omega, "omega_low": low, "omega_high": high, "w2": got.w2, "w2_se": float(np.sqrt(got.covariance[0, 0])),
        "offset": got.constant / got.w2 if got.w2 else float("nan"), "omega_height": at_height,
        "windows": got.windows, "rejected": 0 if alone else sum(w.plant.rejected for w, _ in chosen),
        "clusters": got.clusters, "clustered_by": "block" if alone else "locus",
        "condition_number": got.condition, "rms": got.rms / abs(got.w2), "warning": _warning(got, at_height),
    }  # fmt: skip


def solve(chosen: Sequence[tuple[Windows, NDArray[np.int64]]], *, blocks: bool = False) -> PlantFit | None:
    """Least squares over test functions of several trials.

    chosen: windows with the frames used.  blocks: cut each piece into blocks of two bump widths, for a locus that stands alone;
    bumps that share no sample have independent sensor noise.  None where w2 cannot be told.
    """
    chosen = [(w, i) for w, i in chosen if len(i)]
    if not chosen:
        return None
    acceleration = np.concatenate([w.plant.acceleration[i] for w, i in chosen])
    lever = np.concatenate([w.plant.lever[i] for w, i in chosen])
    cluster = np.concatenate([k * 1_000_000 + _pieces(w, i, blocks) for k, (w, i) in enumerate(chosen)])
    noise = [w.plant.noise_in_regression(len(i)) for w, i in chosen]
    return fit(acceleration, lever, cluster, Noise(*(np.concatenate(column) for column in zip(*noise, strict=True))))


def _pieces(w: Windows, index: NDArray[np.int64], blocks: bool) -> NDArray[np.int64]:
    return index // (2 * w.plant.bump.reach) if blocks else w.plant.cluster[index]


def _warning(got: PlantFit, at_height: float) -> str:
    """Why an omega should not be trusted, in words; empty where nothing speaks against it."""
    if got.w2 <= 0:
        return "w2 is not positive: the CoM does not fall away from the ZMP here"
    if got.clusters < 3:
        return f"the interval rests on {got.clusters} independent piece{'s' * (got.clusters > 1)}"
    ratio = got.w2 / at_height**2
    if not 0.5 < ratio < 1.5:
        return f"w2 is {ratio:.2f} of g/z: some effect is missing, this is no natural frequency"
    return ""


# -- held-out error ---------------------------------------------------------------------------------------------------


def judge(mine: Sequence[Windows], evaluation: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Rows of `heldout` for one subject and axis: the paper's equation on trials that w2 has not seen.

    The base rung has no constant: an offset is an effect to be named (unless `evaluation.offset` is train). Yields nothing where
    no trial can be left out.
    """
    for fold, train, test in folds(mine, evaluation):
        got = solve([(w, w.picked) for w in train])
        if got is None or (got.w2 <= 0 and evaluation["w2"] == "fit"):
            continue
        offset = _offset(train, got.w2, evaluation)
        for w in test:
            yield _judged(w, fold, _w2(w, got.w2, evaluation), offset)


class Named(Protocol):
    """A trial, and what the config may call it."""

    @property
    def trial(self) -> str:
        """The trial, as in the tables."""
        ...

    @property
    def names(self) -> frozenset[str]:
        """What the config may call it under `train` and `test`."""
        ...


T = TypeVar("T", bound=Named)

BOTH, TRAIN, TEST, NEITHER = "both", "train", "test", "neither"


def use(called: Collection[str], evaluation: Mapping[str, Any]) -> str:
    """What the config lets a trial be used for: TRAIN, TEST, NEITHER; BOTH, in turn, where it asks for nothing.

    called: what the trial may be called, see `plumbline.study.names`.
    """
    train, test = set(evaluation["train"]), set(evaluation["test"])
    if not train and not test:
        return BOTH
    if test & set(called):
        return TEST
    return TRAIN if not train or train & set(called) else NEITHER


def folds(mine: Sequence[T], evaluation: Mapping[str, Any]) -> Iterator[tuple[int, list[T], list[T]]]:
    """(number, training trials, test trials): eight folds of whole trials (one by one when fewer), or as the config asks."""
    if evaluation["train"] or evaluation["test"]:
        uses = [use(w.names, evaluation) for w in mine]
        yield 0, [w for w, u in zip(mine, uses, strict=True) if u == TRAIN], [w for w, u in zip(mine, uses, strict=True) if u == TEST]
        return
    number = min(FOLDS, len(mine))
    if number < 2:
        return
    for k in range(number):
        yield k + 1, [w for i, w in enumerate(mine) if i % number != k], list(mine[k::number])


def _w2(w: Windows, fitted: float, evaluation: Mapping[str, Any]) -> float:
    return fitted if evaluation["w2"] == "fit" else G / w.plant.height


def _offset(train: Sequence[Windows], fitted: float, evaluation: Mapping[str, Any]) -> float:
    if evaluation["offset"] == "none":
        return 0.0
    errors = [zmp_error(w.plant.acceleration, w.plant.lever, _w2(w, fitted, evaluation))[w.picked] for w in train]
    return float(np.mean(np.concatenate(errors)))


def _judged(w: Windows, fold: int, w2: float, offset: float) -> dict[str, Any]:
    plant, index = w.plant, w.picked
    error = zmp_error(plant.acceleration, plant.lever, w2)[index] - offset
    free = free_runs(plant, w2, offset)
    miss = (free - plant.x)[np.isfinite(free)]
    return {
        "trial": w.trial, "subject": w.subject, "task": w.task, "condition": w.condition, "axis": w.axis, "fold": fold,
        "w2": w2, "offset": offset, "windows": len(index), "square_sum": float(error @ error),
        "noise_variance": plant.noise_variance(w2), "free_run_frames": len(miss), "free_run_square_sum": float(miss @ miss),
    }  # fmt: skip


def free_runs(plant: Plant, w2: float, offset: float = 0.0) -> Array:
    """Free-run CoM of each unbroken piece of a trial [m], shape (n,); NaN where masked or where a piece is under 0.5 s."""
    out = np.full(len(plant.x), np.nan)
    if w2 <= 0:
        return out
    for piece in range(int(plant.cluster.max(initial=-1)) + 1):
        index = np.flatnonzero(plant.cluster == piece)
        if len(index) >= 0.5 * plant.rate:
            out[index] = free_motion(plant.x[index], plant.p[index] + offset, float(np.sqrt(w2)), plant.rate)[0]
    return out
