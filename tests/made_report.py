"""A report page of a made study, with its figures, for the tests."""

from pathlib import Path
from typing import Any

import made_tables
import numpy as np
import pandas as pd

from plumbline import report
from plumbline.figures import _style, clusters, fit, ladder, loci, residuals, signals, trust, where

ROOT = Path(__file__).resolve().parents[1]
CAPTIONS = {stage: (ROOT / "workflow" / "report" / f"{stage}.rst").read_text(encoding="utf-8") for stage in report.TITLES}


def drawn(made: dict[str, Any], results: Path) -> Path:
    """Every figure of a study of one part, below `results`."""
    _style.save(signals.draw(made["signals"], made["pushes"], made["coverage"]), results / "signals" / "_part-0001.svg")
    _style.save(loci.draw(made["signals"], made["loci"], made["fit"]), results / "loci" / "_part-0001.svg")
    tables_of_trust = ("trust", "rls", "signals", "loci", "clusters", "controller")
    _style.save(trust.draw(**{k: made[k] for k in tables_of_trust}), results / "trust" / "_part-0001.svg")
    _style.save(clusters.draw(**{k: made[k] for k in ("clusters", "choice", "controller")}), results / "clusters" / "_part-0001.svg")
    _style.save(fit.draw(made["fit"]), results / "fit" / "_part-0001.svg")
    _style.save(residuals.draw(made["residuals"]), results / "residuals" / "_part-0001.svg")
    _style.save(where.draw(made["where"]), results / "where" / "_all.svg")
    _style.save(ladder.draw(made["ladder"]), results / "ladder.svg")
    return results


def page(made: dict[str, Any], results: Path | None = None, study: str = "made study", **config: Any) -> str:
    """The page; without `results` it carries no figures."""
    used = {**made_tables.CONFIG, **config}
    pictures = report.pictures(results, ["part-0001"], CAPTIONS, used) if results else []
    return report.page(study, {k: v for k, v in made.items() if k != "verdict"}, made["verdict"], used, pictures)


# -- what is missing --------------------------------------------------------------------------------------------------

FACTOR = 10.0
CANDIDATES = ["axis", "subject", "effect", "status", "family", "before", "after", "fall_low", "fall_high", "q", "vif", "trials_80"]
CANDIDATES += ["parameters", "reason"]
KINDS = ("clean", "found", "family", "unexplained", "unjudged")


def criticised(made: dict[str, Any], kind: str = "found") -> dict[str, Any]:
    """A made study with a made-up verdict: nothing missing, ang_mom, one of two constants, something unexplained, or not judged.

    The residuals get a wave of 5 mm; where ang_mom is found, that is what it contributes.
    """
    out = {**made, "verdict": {**made["verdict"], "model": ["ang_mom"] if kind == "found" else []}}
    if kind not in ("clean", "unjudged"):
        wave = 5e-3 * np.sin(2.5 * made["residuals"]["time"])
        moved = {k: made["residuals"][k] + wave for k in ("error", "zmp_model")}
        out["residuals"] = made["residuals"].assign(**moved)
    out["contributions"] = _contributions(out["residuals"], made["residuals"], kind)
    rows = [r | {"axis": a} for a in ("lateral", "forward") for r in _candidates(kind if a == "lateral" or kind == "unjudged" else "")]
    out["candidates"] = pd.DataFrame(rows, columns=CANDIDATES)
    out["ladder"] = _ladder(made["ladder"], kind)
    by_axis = {a: _blocks(b, kind if a == "lateral" or kind == "unjudged" else "forward") for a, b in made["verdict"]["by_axis"].items()}
    by_subject = {k: _blocks(b, kind) for k, b in made["verdict"]["by_subject"].items()}
    out["verdict"] |= {**by_axis["lateral"], "by_axis": by_axis, "by_subject": by_subject}
    return out


def _contributions(after: pd.DataFrame, before: pd.DataFrame, kind: str) -> pd.DataFrame:
    keys = ["trial", "subject", "task", "condition", "axis", "frame", "time", "com", "velocity"]
    wave = after["error"] - before["error"]
    more = {"after + ang_mom": before["error"], "effect ang_mom": wave} if kind == "found" else {}
    table = after[keys].assign(before=after["error"], **more, **{"effect gain": 0.2 * before["error"]})
    return table[table["frame"] % 5 == 0].dropna(subset=["before"]).iloc[: 0 if kind == "unjudged" else None]


def _candidates(kind: str) -> list[dict[str, Any]]:
    blank = dict.fromkeys(("before", "after", "fall_low", "fall_high", "q", "vif", "trials_80"), np.nan)
    blank |= {"subject": "all", "family": "", "parameters": "{}", "reason": ""}
    tried = {"after": 4e-3, "fall_low": -1e-4, "fall_high": 2e-4, "q": 0.6, "vif": 1.4, "trials_80": 400.0}
    rows = [
        {"effect": "gain", "status": "idle", **tried},
        {"effect": "crosstalk", "status": "refused", **tried, "reason": "crosstalk: height = 0.1 m is not possible"},
        {"effect": "inertia", "status": "absorbed", "reason": "a fitted w2 takes all of it"},
        {"effect": "rail", "status": "lacking", "reason": "cannot be judged: needs rail_x"},
    ]
    sure = {"before": 4e-3, "after": 3e-4, "fall_low": 3e-3, "fall_high": 4e-3, "q": 1e-6, "vif": 1.2, "trials_80": 3.0}
    if kind == "found":
        rows.append({"effect": "ang_mom", "status": "found", **sure, "family": "ang_mom"})
    if kind == "family":
        rows.append({"effect": "", "status": "found", **sure, "family": "offset, com_bias"})
    return [blank | r for r in rows] if kind != "unjudged" else []


def _ladder(clean: pd.DataFrame, kind: str) -> pd.DataFrame:
    """Where something is missing, the base is ten times as far off; where it is found, one rung helps and the next does not."""
    errors = ["error_mm", "ci_low_mm", "ci_high_mm"]
    worse = FACTOR if kind not in ("clean", "unjudged") else 1.0
    base = clean.assign(**{k: clean[k].where(clean["axis"] != "lateral", worse * clean[k]) for k in errors})
    if kind != "found":
        return base
    first = clean[clean["axis"] == "lateral"].assign(model="+ ang_mom", effects="ang_mom")
    second = first.assign(model="+ gain", effects="ang_mom, gain", error_mm=0.99 * first["error_mm"])
    return pd.concat([base, first, second], ignore_index=True)


def _blocks(blocks: dict[str, Any], kind: str) -> dict[str, Any]:
    control = {
        "base_error_mm": 3.1,
        "model_error_mm": 3.1,
        "final_error_mm": 3.1,
        "noise_floor_mm": 3.0,
        "missing": [],
        "unexplained": False,
    }
    control |= {"description": "", "reason": "no candidate predicts loci left out better"}
    if kind == "unjudged":
        return blocks
    if kind == "forward":
        control, kind = blocks["control"], "clean"
    plant = blocks["plant"] | {"missing": [], "unexplained": False, "reason": "held-out error is 1.02 of the noise floor"}
    plant |= {"cannot_judge": {"rail": "needs rail_x"}, "separate": [], "refused": []}
    return {"plant": plant | _said(kind, plant["base_error_mm"]), "control": control}


def _said(kind: str, floor: float) -> dict[str, Any]:
    error = floor * (1 if kind == "clean" else FACTOR)
    entry = {"in_model": True, "error_before_mm": error, "error_after_mm": floor, "q_value": 1e-6, "parameters": {}}
    return {"base_error_mm": error, "model_error_mm": error, "final_error_mm": error} | _found(kind, floor, entry)


def _found(kind: str, floor: float, entry: dict[str, Any]) -> dict[str, Any]:
    if kind == "found":
        beta = {"beta": {"value": -1.05, "unit": "1", "ci95": [-1.08, -1.02]}}
        refused = {"effects": ["gain", "crosstalk"], "error_mm": 0.5, "reason": "crosstalk: height = 0.1 m is not possible"}
        found = entry | {"effect": "ang_mom", "family": ["ang_mom"], "parameters": beta}
        return {"missing": [found], "final_error_mm": floor, "refused": [refused]}
    if kind == "family":
        found = entry | {"effect": None, "in_model": False, "family": ["offset", "com_bias"]}
        apart = "offset or com_bias: the CoP of each plate against the feet, or an empty plate"
        return {"missing": [found], "final_error_mm": floor, "separate": [apart]}
    if kind == "unexplained":
        where = "in the ZMP against the shear force (the moment side), 3.2 times what noise and a model's usual faults give"
        said = f"{where}; it looks like a cubic of the CoM; no listed effect explains it"
        return {"unexplained": True, "description": said, "reason": "structure above the noise is left on trials left out"}
    return {}
