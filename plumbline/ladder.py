"""The ladder: held-out error of each model, and the verdict other programs read."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import control_verdict, findings
from plumbline.effects import Effect, catalogue
from plumbline.plant import AXES
from plumbline.tables import TABLES, empty

Array = NDArray[np.float64]
Models = Sequence[tuple[str, Sequence[str]]]

RESAMPLES = 2000
SEED = 20130101  # the intervals are the same at each run

NOTHING = {"kind": "weak"} | dict.fromkeys(("error_mm", "ci_low_mm", "ci_high_mm", "noise_floor_mm"), float("nan"))
"""The base rung where no trial could be judged."""


def ladder(
    heldout: pd.DataFrame, rungs: pd.DataFrame | None = None, control: pd.DataFrame | None = None,
    effects: Mapping[str, Effect] | None = None, unsettled: Collection[str] = (),
) -> pd.DataFrame:  # fmt: skip
    """Table `ladder`: the base rung and one per model, pooled and per task, subject and condition, weak and free-run; and of the law.

    heldout, rungs, control: tables of all parts (None: no such rungs).  effects: the catalogue, default the library's.  Errors are
    pooled as rms over test functions (frames for the free run), in mm.
    """
    rows: list[dict[str, Any]] = []
    rungs = empty("rungs") if rungs is None else rungs
    noise = heldout[["trial", "axis", "noise_variance"]]
    for axis in AXES:
        mine = heldout[heldout["axis"] == axis]
        for task, subject, condition, group in _groups(mine):
            key = {"axis": axis, "task": task, "subject": subject, "condition": condition}
            rows += [{"ledger": "plant", **key, "model": "base", "effects": "", **r} for r in rungs_of(group) or [NOTHING]]
        above = rungs[rungs["axis"] == axis].merge(noise, on=["trial", "axis"])
        for (_, model, names), mine in above.groupby(["rung", "model", "effects"], sort=True, observed=True):
            for task, subject, condition, group in _groups(mine):
                key = {"axis": axis, "task": task, "subject": subject, "condition": condition}
                rows += [{"ledger": "plant", **key, "model": model, "effects": names, **r} for r in rungs_of(group)]
    rows += control_rungs(empty("control") if control is None else control, effects, unsettled)
    return pd.DataFrame(rows, columns=[c.name for c in TABLES["ladder"]])


def control_rungs(
    control: pd.DataFrame, effects: Mapping[str, Effect] | None, unsettled: Collection[str]
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Rungs of the control ledger: the base law, and each effect found; error of the simulated CoM on loci left out."""
    scopes = [("all", control), *((str(s), rows) for s, rows in control.groupby("subject", observed=True))]
    for subject, rows in scopes:
        said = control_verdict.judge(rows, (), effects, settled=subject not in unsettled)
        if said["missing"] is None:
            continue
        names: list[str] = []
        for entry in [None, *said["missing"]]:
            names += [entry["effect"]] if entry else []
            key = {"axis": "lateral", "task": "all", "subject": subject, "condition": "all"}
            errors = error_mm(*control_verdict.trials(rows, names))
            yield {
                "ledger": "control", **key, "kind": "free_run", "model": "+ " + names[-1] if names else "base", "effects": ", ".join(names),
                **errors, "noise_floor_mm": said["noise_floor_mm"],
            }  # fmt: skip


def _groups(table: pd.DataFrame) -> Iterator[tuple[str, str, str, pd.DataFrame]]:
    yield "all", "all", "all", table
    for task, group in table.groupby("task", observed=True):
        yield str(task), "all", "all", group
    for subject, group in table.groupby("subject", observed=True):
        yield "all", str(subject), "all", group
    for condition, group in table[table["condition"] != ""].groupby("condition", observed=True):
        yield "all", "all", str(condition), group


def rungs_of(group: pd.DataFrame) -> list[dict[str, Any]]:
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


@dataclass(frozen=True)
class Said:
    """What the stages said, all parts: tables `ladder`, `coverage`, `heldout`, `judged`, `candidates`, `control`."""

    ladder: pd.DataFrame
    coverage: pd.DataFrame
    heldout: pd.DataFrame
    judged: pd.DataFrame = field(default_factory=lambda: empty("judged"))
    candidates: pd.DataFrame = field(default_factory=lambda: empty("candidates"))
    control: pd.DataFrame = field(default_factory=lambda: empty("control"))


def verdict(said: Said, evaluation: Mapping[str, Any], effects: Mapping[str, Effect] | None = None, models: Models = ()) -> dict[str, Any]:
    """The interface `results/verdict.json`: the lateral axis pooled on top, then by axis and by subject.

    effects: the catalogue, default the library's.  models: of the config, none for `auto`.
    """
    effects = effects if effects is not None else catalogue()
    model = {axis: _model(said, axis, effects, models) for axis in AXES}
    by_axis = {axis: _blocks(said, axis, "all", effects, model[axis]) for axis in AXES}
    for axis, block in by_axis.items():
        block["plant"]["reason"] = "; ".join(filter(None, [block["plant"]["reason"], *_not_judged(said.ladder, axis, effects, models)]))
    subjects = sorted(said.coverage["subject"].unique())
    return {
        "schema_version": 1,
        "half_width_s": evaluation["half_width"],
        "model": model["lateral"],
        **by_axis["lateral"],
        "by_axis": by_axis,
        "by_subject": {s: _blocks(said, "lateral", s, effects, model["lateral"]) for s in subjects},
        "broken_effects": [f"{file}: {error}" for file, error in getattr(effects, "broken", [])],
    }


def _model(said: Said, axis: str, effects: Mapping[str, Effect], models: Models) -> list[str]:
    """Effects of the last model configured; with `auto` those found."""
    if models:
        return list(models[-1][1])
    found = said.candidates[
        (said.candidates["axis"] == axis) & (said.candidates["subject"] == "all") & (said.candidates["status"] == "found")
    ]
    plant = [str(e) for e in found["effect"] if e]
    control = _control(said, axis, "all", effects, ())["missing"]
    return [*plant, *(m["effect"] for m in control or [])]


def unsettled(judged: pd.DataFrame) -> set[str]:
    """Subjects (or all) whose lateral plant lacks something that no effect explains: nothing is said about their law."""
    mine = judged[(judged["axis"] == "lateral") & ((judged["left"] != "") | (judged["shapes"] != ""))]
    return set(mine["subject"])


def _blocks(said: Said, axis: str, subject: str, effects: Mapping[str, Effect], model: Sequence[str]) -> dict[str, Any]:
    return {"plant": _plant(said, axis, subject, effects, model), "control": _control(said, axis, subject, effects, model)}


def _plant(said: Said, axis: str, subject: str, effects: Mapping[str, Effect], model: Sequence[str]) -> dict[str, Any]:
    coverage = said.coverage if subject == "all" else said.coverage[said.coverage["subject"] == subject]
    rungs = said.ladder[
        (said.ladder["ledger"] == "plant") & (said.ladder["kind"] == "weak") & (said.ladder["axis"] == axis)
        & (said.ladder["subject"] == subject) & (said.ladder["task"] == "all") & (said.ladder["condition"] == "all")
    ].dropna(subset=["error_mm"])  # fmt: skip
    base = rungs[rungs["model"] == "base"]
    if base.empty:
        return blank(f"no held-out error: {_why_no_error(coverage)}")
    floor = float(base["noise_floor_mm"].iloc[0])
    errors: dict[str, float | None] = {
        "base_error_mm": float(base["error_mm"].iloc[0]), "model_error_mm": float(rungs["error_mm"].iloc[-1]),
        "final_error_mm": None, "noise_floor_mm": floor if floor == floor else None,
    }  # fmt: skip
    notes = _notes(floor, coverage, coverage["trial"].isin(said.heldout.loc[said.heldout["axis"] == axis, "trial"]))
    about = said.judged[(said.judged["axis"] == axis) & (said.judged["subject"] == subject)]
    if about.empty or about["reason"].iloc[0]:
        why = about["reason"].iloc[0] if len(about) else "no trial could be used"
        return blank("; ".join([f"not judged: {why}", *notes])) | errors
    rows = said.candidates[(said.candidates["axis"] == axis) & (said.candidates["subject"] == subject)]
    out: dict[str, Any] = errors | findings.block(about.iloc[0], rows, effects, model)
    if not out["missing"] and not out["unexplained"]:
        out["final_error_mm"] = errors["base_error_mm"]
    if len(out["missing"]) == 1:
        out["missing"][0]["error_before_mm"] = errors["base_error_mm"]
    out["reason"] = findings.reason(bool(out["unexplained"]), bool(out["missing"]), out["final_error_mm"], out["noise_floor_mm"])
    return out | {"reason": "; ".join([out["reason"], *notes])}


def _control(said: Said, axis: str, subject: str, effects: Mapping[str, Effect], model: Sequence[str]) -> dict[str, Any]:
    if axis != "lateral":
        return blank("the controller is judged on the lateral axis alone")
    rows = said.control if subject == "all" else said.control[said.control["subject"] == subject]
    return control_verdict.judge(rows, model, effects, settled=subject not in unsettled(said.judged))


def blank(reason: str) -> dict[str, Any]:
    """A block that claims nothing."""
    errors: dict[str, Any] = dict.fromkeys(("base_error_mm", "model_error_mm", "final_error_mm", "noise_floor_mm"))
    said = {"missing": None, "unexplained": None, "description": "", "reason": reason}
    return errors | said | {"refused": [], "cannot_judge": {}, "separate": []}


def _notes(floor: float, coverage: pd.DataFrame, judged: "pd.Series[bool]") -> Iterator[str]:
    """What a reader must know beside.  judged: the rows of `coverage` that a held-out error stands behind."""
    able = (coverage["com_method"] != "none").sum()
    if judged.sum() < able:
        rest = "the others were not asked for, or no w2 could be found on the rest"
        yield f"{judged.sum()} of the {able} trials with a CoM were judged, {rest}"
    methods = coverage.loc[judged, "com_method"]
    if 0 < (methods == "force").sum() < len(methods):
        share = f"{(methods == 'force').sum()} of {len(methods)} judged trials"
        yield f"in {share} the CoM was integrated from the force and follows it by assumption"
    if floor != floor:
        yield f"the noise floor is not identifiable: {_why_no_floor(coverage[judged])}"


def _not_judged(ladder: pd.DataFrame, axis: str, effects: Mapping[str, Effect], models: Models) -> Iterator[str]:
    """Configured models without a rung, whole or for some subjects: their error is not that of the same people as the base's."""
    mine = ladder[(ladder["ledger"] == "plant") & (ladder["axis"] == axis) & (ladder["kind"] == "weak") & (ladder["subject"] != "all")]
    everybody = set(mine.loc[(mine["model"] == "base") & mine["error_mm"].notna(), "subject"])
    for name, members in models:
        without = sorted(everybody - set(mine.loc[mine["model"] == name, "subject"]))
        if without and any(effects[m].ledger == "plant" for m in members):
            yield f"model '{name}' has no rung for {', '.join(without)}: what it adds is not seen there, or needs what some trial lacks"


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
