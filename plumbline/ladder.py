"""The ladder: held-out error of each model, and the verdict other programs read."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.plant import AXES
from plumbline.tables import TABLES

Array = NDArray[np.float64]

RESAMPLES = 2000
SEED = 20130101  # the intervals are the same at each run

NOT_BUILT = "not judged yet: this version measures the paper's equation and does not search for missing effects"


NOTHING = {"kind": "weak"} | dict.fromkeys(("error_mm", "ci_low_mm", "ci_high_mm", "noise_floor_mm"), float("nan"))
"""The base rung where no trial could be judged."""


def ladder(heldout: pd.DataFrame) -> pd.DataFrame:
    """Table `ladder`: the base rung, pooled and per task, subject and condition, weak and free-run.

    heldout: the table of all parts. Errors are pooled as rms over test functions (frames for the free run), in mm.
    """
    rows: list[dict[str, Any]] = []
    for axis in AXES:
        mine = heldout[heldout["axis"] == axis]
        for task, subject, condition, group in _groups(mine):
            key = {"axis": axis, "task": task, "subject": subject, "condition": condition}
            rows += [{"ledger": "plant", **key, "model": "base", "effects": "", **r} for r in rungs(group) or [NOTHING]]
    return pd.DataFrame(rows, columns=[c.name for c in TABLES["ladder"]])


def _groups(table: pd.DataFrame) -> Iterator[tuple[str, str, str, pd.DataFrame]]:
    yield "all", "all", "all", table
    for task, group in table.groupby("task", observed=True):
        yield str(task), "all", "all", group
    for subject, group in table.groupby("subject", observed=True):
        yield "all", str(subject), "all", group
    for condition, group in table[table["condition"] != ""].groupby("condition", observed=True):
        yield "all", "all", str(condition), group


def rungs(group: pd.DataFrame) -> list[dict[str, Any]]:
    """Error, interval and floor of one group of trials, weak and free-run; nothing for an empty group."""
    if group.empty:
        return []
    square, count = group["square_sum"].to_numpy(), group["windows"].to_numpy(float)
    noise = group["noise_variance"].to_numpy()
    floor = 1e3 * float(np.sqrt(np.average(noise, weights=count)))
    out = [{"kind": "weak", **error_mm(square, count), "noise_floor_mm": floor}]
    square, count = group["free_run_square_sum"].to_numpy(), group["free_run_frames"].to_numpy(float)
    if count.sum():
        out.append({"kind": "free_run", **error_mm(square, count), "noise_floor_mm": float("nan")})
    return out


def error_mm(square: Array, count: Array) -> dict[str, float]:
    """Pooled rms in mm with its 95 % interval, whole trials resampled (NaN below three trials: no interval is honest there).

    square: sum of squares per trial [m2], shape (t,).  count: terms behind each, shape (t,).
    """
    low = high = float("nan")
    if len(square) >= 3:
        pick = np.random.default_rng(SEED).integers(0, len(square), (RESAMPLES, len(square)))
        means = square[pick].sum(axis=1) / count[pick].sum(axis=1)
        low, high = (float(v) for v in 1e3 * np.sqrt(np.quantile(means, [0.025, 0.975])))
    return {"error_mm": 1e3 * float(np.sqrt(square.sum() / count.sum())), "ci_low_mm": low, "ci_high_mm": high}


# -- verdict ----------------------------------------------------------------------------------------------------------


def verdict(table: pd.DataFrame, evaluation: Mapping[str, Any], coverage: pd.DataFrame, heldout: pd.DataFrame) -> dict[str, Any]:
    """The interface `results/verdict.json`: the lateral axis pooled on top, then by axis and by subject.

    table: the ladder.  coverage: says why a floor or an error is absent.  heldout: which trials were judged.
    """
    by_axis = {axis: _blocks(table, axis, "all", coverage, heldout) for axis in AXES}
    subjects = sorted(coverage["subject"].unique())
    return {
        "schema_version": 1,
        "half_width_s": evaluation["half_width"],
        "model": [],
        **by_axis["lateral"],
        "by_axis": by_axis,
        "by_subject": {s: _blocks(table, "lateral", s, coverage[coverage["subject"] == s], heldout) for s in subjects},
    }


def _blocks(table: pd.DataFrame, axis: str, subject: str, coverage: pd.DataFrame, heldout: pd.DataFrame) -> dict[str, Any]:
    chosen = table[
        (table["ledger"] == "plant") & (table["kind"] == "weak") & (table["model"] == "base") & (table["axis"] == axis)
        & (table["subject"] == subject) & (table["task"] == "all") & (table["condition"] == "all")
    ]  # fmt: skip
    base = float(chosen["error_mm"].iloc[0]) if len(chosen) and chosen["error_mm"].notna().all() else None
    floor = float(chosen["noise_floor_mm"].iloc[0]) if base is not None else None
    judged = coverage["trial"].isin(heldout.loc[heldout["axis"] == axis, "trial"])
    return {
        "plant": _block(base, floor if floor == floor else None, _reason(base, floor, coverage, judged)),
        "control": _block(None, None, "not judged yet: the controller is not identified in this version"),
    }


def _block(base: float | None, floor: float | None, reason: str) -> dict[str, Any]:
    return {
        "base_error_mm": base, "model_error_mm": base, "final_error_mm": None, "noise_floor_mm": floor,
        "missing": None, "unexplained": None, "description": "", "reason": reason,
    }  # fmt: skip


def _reason(base: float | None, floor: float | None, coverage: pd.DataFrame, judged: "pd.Series[bool]") -> str:
    """Why nothing more is said.  judged: the rows of `coverage` that a held-out error stands behind."""
    if base is None:
        return f"no held-out error: {_why_no_error(coverage)}"
    said = NOT_BUILT
    able = (coverage["com_method"] != "none").sum()
    if judged.sum() < able:
        rest = "the others were not asked for, or no w2 could be found on the rest"
        said += f"; {judged.sum()} of the {able} trials with a CoM were judged, {rest}"
    methods = coverage.loc[judged, "com_method"]
    if 0 < (methods == "force").sum() < len(methods):
        share = f"{(methods == 'force').sum()} of {len(methods)} judged trials"
        said += f"; in {share} the CoM was integrated from the force and follows it by assumption"
    if floor != floor:
        said += f"; the noise floor is not identifiable: {_why_no_floor(coverage[judged])}"
    return said


def _why_no_error(coverage: pd.DataFrame) -> str:
    if coverage.empty:
        return "no trial could be used (see exclusions.parquet)"
    judged = coverage[coverage["com_method"] != "none"]
    if judged.empty:
        return "no trial has a CoM; " + "; ".join(sorted(set(coverage["limitation"]) - {""}))
    if judged.groupby("subject")["trial"].nunique().max() < 2:
        return "one trial with a CoM and a ZMP per subject; at least two of one subject are needed to leave one out"
    return "w2 cannot be told on this axis: the CoM hardly moves against the ZMP there"


def _why_no_floor(judged: pd.DataFrame) -> str:
    causes = {
        "the CoM was integrated from the force": (judged["com_method"] == "force").sum(),
        "files were low-passed before they came to us": ((judged["com_method"] != "force") & judged["filtered_before"]).sum(),
    }
    return "; ".join(f"in {n} of {len(judged)} judged trials {cause}" for cause, n in causes.items() if n)
