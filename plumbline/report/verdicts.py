"""Tables on what is missing: every candidate of the catalogue, and the verdict of each subject."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from plumbline.effects import Effect
from plumbline.report.missing import rate, value
from plumbline.report.sheets import STATUS, Sheet, Show, decimals, joined, sheet, status, text, whole
from plumbline.report.words import number, plural

MANY_TRIALS = 1000  # more trials than this nobody records
REFUSED = 0.5  # [1] share of trials in which a law is refused, above which it is said
INFLATED = 100.0  # [1] variance inflation from which on its size says no more


def all_sheets(tables: Mapping[str, pd.DataFrame], verdict: Mapping[str, Any], effects: Mapping[str, Effect]) -> dict[str, Sheet]:
    """Sheets `candidates`, `laws`, `subjects`.  tables: candidates, control, where those stages were run.  effects: the catalogue."""
    return {
        "candidates": candidates(tables.get("candidates"), effects),
        "laws": laws(tables.get("control"), effects),
        "subjects": subjects(verdict),
    }


def candidates(table: pd.DataFrame | None, effects: Mapping[str, Effect]) -> Sheet:
    """What became of every effect, all subjects together."""
    empty = "No effect was judged."
    if table is None:
        return Sheet([], [], frozenset(), empty=empty)
    pooled = table[table["subject"] == "all"]
    order = {k: i for i, k in enumerate(STATUS)}
    shown = pooled.assign(
        name=[_named(row, effects) for _, row in pooled.iterrows()],
        order=pooled["status"].map(order), sideways=pooled["axis"] != "lateral",
        reason=[_sized(row) for _, row in pooled.iterrows()],
        fall=[_between(a, b) for a, b in zip(pooled["fall_low"], pooled["fall_high"], strict=True)],
    ).sort_values(["sideways", "order", "effect"], kind="stable")  # fmt: skip
    columns: dict[str, tuple[str, Show]] = {
        "axis": ("axis", text), "name": ("effect", text), "status": ("what became of it", status),
        "before": ("error without it [mm]", _mm), "after": ("with it [mm]", _mm), "fall": ("fall, 95 % interval [mm]", _as_is),
        "q": ("q", _q), "vif": ("VIF", _vif), "trials_80": ("trials for 80 % power", _trials), "reason": ("why", joined),
    }  # fmt: skip
    made = sheet(shown, columns, "candidates.parquet", empty)
    each = table["subject"].nunique() - 1
    more = f"Those of {plural(each, 'single subject')} are in results/candidates." if each > 1 else ""
    return replace(made, note=f"{made.note} {more}".strip())


def _sized(row: pd.Series) -> str:
    """Why, and of what is not named the size that was fitted."""
    sizes = [value(k, v, None).rstrip(".") for k, v in json.loads(row["parameters"]).items()] if row["status"] == "settled" else []
    return "; ".join([*sizes, *([row["reason"]] if row["reason"] else [])])


def laws(table: pd.DataFrame | None, effects: Mapping[str, Effect]) -> Sheet:
    """Every law that was simulated, all subjects together: errors on loci left out, and how much better than the paper's it predicts."""
    empty = "No law was simulated."
    if table is None or table.empty:
        return Sheet([], [], frozenset(), empty=empty)
    loop = table[(table["mode"] == "loop") & (table["reason"] == "")]
    key = ["subject", "task", "condition", "trial"]
    base = loop.loc[loop["candidate"] == "", [*key, "score"]].rename(columns={"score": "paper"})
    loop = loop.merge(base, on=key)  # a law that was not tried in all is compared where it was
    added = ["loci", "frames", "square_sum", "zmp_square_sum", "score", "paper"]
    sums = loop.groupby("candidate", as_index=False, sort=True)[added].sum()
    refused = loop.groupby("candidate")["refused"].mean() > REFUSED
    shown = sums.assign(
        com=np.sqrt(sums["square_sum"] / sums["frames"]), zmp=np.sqrt(sums["zmp_square_sum"] / sums["frames"]),
        gain=sums["paper"] - sums["score"],
        name=[_law(c, effects) for c in sums["candidate"]],
        said=["too small, or at a bound" if refused[c] else "" for c in sums["candidate"]],
    ).sort_values(["said", "gain", "candidate"], ascending=[True, False, True], kind="stable")  # fmt: skip
    columns: dict[str, tuple[str, Show]] = {
        "name": ("effects beside the paper's law", text), "loci": ("loci", whole), "com": ("error of the CoM [mm]", _mm),
        "zmp": ("error of the ZMP [mm]", _mm),
        "gain": ("better than the paper's law by", decimals(1)), "said": ("its size", text),
    }  # fmt: skip
    return sheet(shown, columns, "control", empty)


def _law(candidate: str, effects: Mapping[str, Effect]) -> str:
    """Effects of a law; one alone with its title."""
    return f"{candidate}: {effects[candidate].title}" if candidate in effects else candidate.replace("+", ", ") or "none"


def _named(row: pd.Series, effects: Mapping[str, Effect]) -> str:
    """Title and id; a family by its members."""
    name = str(row["effect"])
    if not name:
        return f"one of {row['family']}"
    return f"{name}: {effects[name].title}" if name in effects else name


def subjects(verdict: Mapping[str, Any]) -> Sheet:
    """The lateral verdict of each subject, where there are several."""
    each = verdict["by_subject"]
    rows = (
        [{"subject": name, **block["plant"], "said": _said(block["plant"])} for name, block in sorted(each.items())]
        if len(each) > 1
        else []
    )
    names = ["subject", "base_error_mm", "final_error_mm", "noise_floor_mm", "said", "reason"]
    table = pd.DataFrame(rows, columns=names).astype(dict.fromkeys(names[1:4], float))
    columns: dict[str, tuple[str, Show]] = {
        "subject": ("subject", text), "base_error_mm": ("error [mm]", _number), "final_error_mm": ("with what is missing [mm]", _number),
        "noise_floor_mm": ("noise floor [mm]", _number), "said": ("missing", joined), "reason": ("why", joined),
    }  # fmt: skip
    return sheet(table, columns, "judged", "One subject.")


def _said(block: Mapping[str, Any]) -> str:
    if block["missing"] is None:
        return "not judged"
    names = [str(m["effect"] or f"one of {', '.join(m['family'])}") for m in block["missing"]]
    return ", ".join([*names, *(["something unexplained"] if block["unexplained"] else [])]) or "nothing"


# -- how values are shown ---------------------------------------------------------------------------------------------


def _as_is(value: str) -> str:
    return value


def _number(value: float) -> str:
    return number(value) or "\u2013"


def _mm(value: float) -> str:
    return number(1e3 * value) or "\u2013"


def _between(low: float, high: float) -> str:
    if low != low or high != high:
        return "\u2013"
    show = decimals(2, 1e3)
    return f"{show(low)} to {show(high)}".replace("-", "\u2212")


def _q(value: float) -> str:
    return rate(value).removeprefix("= ") if value == value else "\u2013"


def _vif(value: float) -> str:
    if value != value:
        return "\u2013"
    return f"{value:.1f}" if value < INFLATED else f"> {INFLATED:g}"


def _trials(value: float) -> str:
    if value != value:
        return "\u2013"
    return f"{value:.0f}" if value < MANY_TRIALS else f"> {MANY_TRIALS}"
