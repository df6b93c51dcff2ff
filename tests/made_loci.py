"""Loci of the paper's closed loop as a batch, and what their truth says of the switches."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import batch, filters, tables
from plumbline.simulate import pendulum

PUBLISHED = {"A": {"omega": 2.740, "k1": 4.038, "k2": 0.875}, "B": {"omega": 2.914, "k1": 2.204, "k2": 0.549}}
RATE = 200.0  # [Hz]
SHORT = 5  # frames at a limit, or inside, that count as no regime of their own: feedback noise chatters at the border


def made(
    name: str, seed: int, n: int = 32, starts: tuple[str, ...] = ("saturated", "unsaturated"), **options: float
) -> list[pendulum.Locus]:
    """`n` loci of each start with the published parameters of condition A or B."""
    out = []
    for k, start in enumerate(starts):
        out += pendulum.loci(n, start=start, seed=1000 * k + seed, **(PUBLISHED[name] | options))
    return out


def batched(loci: list[pendulum.Locus], omega: float) -> batch.Batch:
    """The loci as the pipeline has them."""
    return batch.of_loci([one.x for one in loci], [one.p for one in loci], omega, RATE)


def true_regime(locus: pendulum.Locus, limits: tuple[float, float]) -> NDArray[np.int64]:
    """-1, 0, +1 of each frame, chatter taken out, shape (n,)."""
    p = locus.p_true
    out = (p >= limits[1] - 1e-12).astype(int) - (p <= limits[0] + 1e-12)
    while True:
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(out)) + 1, [len(out)]])
        stay = np.diff(bounds)
        if len(stay) < 2 or stay.min() >= SHORT:
            return out
        k = int(np.argmin(stay))
        out[bounds[k] : bounds[k + 1]] = out[bounds[k] - 1] if k else out[bounds[1]]


def true_switches(locus: pendulum.Locus, limits: tuple[float, float]) -> NDArray[np.float64]:
    """Instants of the switches between regimes [s]."""
    frames = np.flatnonzero(np.diff(true_regime(locus, limits))) + 1
    return np.array([locus.switches[np.argmin(np.abs(locus.switches - (k - 0.5) / RATE))] for k in frames])


def switch_errors(
    loci: list[pendulum.Locus], regime: NDArray[np.int8], lead: int, limits: tuple[float, float]
) -> tuple[NDArray[np.float64], int, int]:
    """Found minus true instant of every switch that was found within 0.15 s [s]; switches missed; switches too many."""
    errors: list[float] = []
    missed = more = 0
    for j, locus in enumerate(loci):
        true = true_switches(locus, limits)
        found = (np.flatnonzero(np.diff(regime[lead : lead + len(locus.x), j])) + 0.5) / RATE
        near = [found[np.argmin(np.abs(found - t))] for t in true if len(found) and np.min(np.abs(found - t)) < 0.15]
        errors += [float(np.min(np.abs(found - t)) * np.sign(found[np.argmin(np.abs(found - t))] - t)) for t in true if len(found)]
        missed += len(true) - len(near)
        more += len(set(found) - set(near))
    out = np.array(errors)
    return out[np.abs(out) < 0.15], missed, more


def tabled(
    groups: dict[str, list[pendulum.Locus]], *, omega: float, kinds: dict[str, str] | None = None
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Tables signals, pushes, loci, coverage, trials of recordings with one locus each.

    groups: condition -> loci.  kinds: condition -> kind of its loci.  omega only sets the filtered columns' height.
    """
    frames, loci, about, trials = [], [], [], []
    for condition, members in groups.items():
        for k, one in enumerate(members):
            key = {
                "trial": f"sub-01_task-lateral_acq-{condition}_run-{k:03d}",
                "subject": "sub-01",
                "task": "lateral",
                "condition": condition,
            }
            frames.append(_frames(one, key, omega))
            kind = (kinds or {}).get(condition, "recovering")
            loci.append(key | {
                "locus": 1, "start": 0.0, "end": one.time[-1], "start_frame": 0, "end_frame": len(one.time) - 1, "kind": kind,
                "side": one.side, "source": "event", "reference": 0.0,
            })  # fmt: skip
            about.append(key | {"com_method": "lab", "filtered_before": False, "mass": 70.0, "height_com": 9.81 / omega**2, "files": ""})
            trials.append({"trial": key["trial"], "events": "[]"})
    pushes = tables.empty("pushes")
    return pd.concat(frames, ignore_index=True), pushes, pd.DataFrame(loci), pd.DataFrame(about), pd.DataFrame(trials)


def _frames(one: pendulum.Locus, key: dict[str, str], omega: float) -> pd.DataFrame:
    zero = np.zeros(len(one.time))
    slow = filters.low_pass(np.column_stack([one.x, one.p]), one.time, 2.0)
    columns = {
        "frame": np.arange(len(one.time)), "time": one.time, "com_x": one.x, "com_y": zero, "com_z": zero + 9.81 / omega**2,
        "zmp_x": one.p, "zmp_y": zero, "zmp_z": zero, "grf_x": 70 * omega**2 * (one.x_true - one.p_true), "grf_y": zero,
        "grf_z": zero + 70 * 9.81, "com_lp_x": slow[:, 0], "zmp_lp_x": slow[:, 1],
        "com_ddot_x": filters.derivatives(slow[:, :1], one.time)[1][:, 0],
    }  # fmt: skip
    return pd.DataFrame(key | columns)
