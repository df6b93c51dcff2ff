"""Tables behind the figures of measured loci: tracks through the phase plane, and single loci frame by frame."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import savgol_filter

Array = NDArray[np.float64]

STEP = 0.025  # [s] between two points of a track
PARABOLA = 0.2  # [s] over which position and velocity of a track are fitted
SIGNALS = ["trial", "frame", "time", "com_x", "zmp_x", "limit_left", "limit_right"]
"""Columns of table `signals` that are needed."""

TRACKS = ["condition", "trial", "locus", "kind", "cluster", "time", "x", "v", "limit_left", "limit_right"]


def tracks(signals: pd.DataFrame, loci: pd.DataFrame, clusters: pd.DataFrame) -> pd.DataFrame:
    """Position and velocity along every locus, every :data:`STEP`: :data:`TRACKS`.

    x [m], v [m/s]: of the parabola fitted to the unfiltered CoM of the locus over 0.2 s around each point (a low-pass would smear the
    push into the locus).  time [s]: since the locus began.  limit_*: edges of the feet [m].
    """
    cluster = clusters.set_index(["trial", "locus"])["cluster"].to_dict()
    parts = []
    for locus, frames in _frames(signals, loci):
        inside = frames[frames["frame"].between(locus.start_frame, locus.end_frame)]
        time = inside["time"].to_numpy(float)
        step = float(np.median(np.diff(time)))
        x, v = _fitted(inside["com_x"].to_numpy(float), step)
        keep = slice(None, None, max(1, round(STEP / step)))
        about = {"condition": locus.condition, "trial": locus.trial, "locus": locus.locus, "kind": locus.kind}
        about |= {"cluster": cluster.get((locus.trial, locus.locus), 0)}
        about |= {side: float(frames[side].median()) for side in ("limit_left", "limit_right")}
        parts.append(pd.DataFrame({"time": time[keep] - locus.start, "x": x[keep], "v": v[keep]}).assign(**about))
    return pd.concat(parts, ignore_index=True)[TRACKS] if parts else pd.DataFrame(columns=TRACKS)


def _fitted(x: Array, step: float) -> tuple[Array, Array]:
    """Position [m] and velocity [m/s] of a moving parabola; at the ends of the first and the last one."""
    width = min(2 * round(PARABOLA / step / 2) + 1, (len(x) - 1) // 2 * 2 + 1)
    return savgol_filter(x, width, 2), savgol_filter(x, width, 2, deriv=1, delta=step)


def _frames(signals: pd.DataFrame, loci: pd.DataFrame) -> Iterator[tuple[Any, pd.DataFrame]]:
    """Each locus with the frames of its trial."""
    by_trial = {str(trial): frames for trial, frames in signals.groupby("trial", sort=False, observed=True)}
    for locus in loci.sort_values(["trial", "locus"]).itertuples(index=False):
        yield locus, by_trial[str(locus.trial)]


# -- the locus of figs. 6 and 7, and that of fig. 8 --------------------------------------------------------------------


def examples(loci: pd.DataFrame, trust: pd.DataFrame) -> pd.DataFrame:
    """One locus per figure: figure, trial, locus.

    figs. 6 and 7: a recovering locus that begins at a limit and comes inside once; fig. 8: a falling one that begins inside and goes to a
    limit. The longest of condition free in which both ways of finding the switch saw it; else of those in which one did.
    """
    both = trust.merge(loci[["trial", "locus", "kind"]], on=["trial", "locus"])
    parts = both.sort_values(["trial", "locus", "part"]).groupby(["trial", "locus"], as_index=False)
    flat = parts.agg(
        condition=("condition", "first"), kind=("kind", "first"), parts=("part", "size"), first=("regime", "first"),
        last=("regime", "last"), rls=("rls", "last"), start=("start", "first"), end=("end", "last"), change=("start", "last"),
    )  # fmt: skip
    flat = flat[(flat["condition"] == "free") & (flat["parts"] == 2)]
    flat = flat.assign(unseen=flat["rls"].isna(), short=-np.minimum(flat["change"] - flat["start"], flat["end"] - flat["change"]))
    flat = flat.sort_values(["unseen", "short", "trial"])
    comes = flat[flat["kind"].str.startswith("recovering") & (flat["first"] != "inside") & (flat["last"] == "inside")]
    goes = flat[(flat["kind"] == "falling") & (flat["first"] == "inside") & (flat["last"] != "inside")]
    rows = [(figure, one) for figure, found in (("fig6", comes), ("fig7", comes), ("fig8", goes)) for one in found.head(1).itertuples()]
    return pd.DataFrame([(figure, one.trial, one.locus) for figure, one in rows], columns=["figure", "trial", "locus"])


def passes(chosen: pd.DataFrame, rls: pd.DataFrame, signals: pd.DataFrame) -> pd.DataFrame:
    """Estimates of both passes along the chosen loci with the measured CoM x and ZMP p [m]: table `rls` with figure, x, p."""
    frames = signals[["trial", "frame", "com_x", "zmp_x"]].rename(columns={"com_x": "x", "zmp_x": "p"})
    both = chosen.merge(rls, on=["trial", "locus"]).merge(frames, on=["trial", "frame"])
    return both.sort_values(["figure", "time"], ignore_index=True)


def switches(chosen: pd.DataFrame, trust: pd.DataFrame) -> pd.DataFrame:
    """Regimes of the chosen loci with their switches: table `trust` with figure."""
    return chosen.merge(trust, on=["trial", "locus"]).sort_values(["figure", "part"], ignore_index=True)
