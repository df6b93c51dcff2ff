"""What was found as rows of the tables `judged` and `candidates`, and from them as blocks of the verdict."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from plumbline.effects import Effect
from plumbline.effects_text import separated
from plumbline.found import Candidate, Finding, Found, Interval
from plumbline.outer import Scale
from plumbline.shapes import SHAPES

Row = dict[str, Any]

WHOLLY = 1000.0  # variance inflation of an effect that the others take
MANY = 500  # trials that nobody records

WHERE = {
    "kinematic": "the acceleration of the CoM against the shear force (the kinematic side)",
    "moment": "the ZMP against the shear force (the moment side)",
    "whole": "the ZMP against the acceleration of the CoM",
}


def judged(axis: str, subject: str, finding: Finding, sizes: tuple[int, int], w2: float, h: float, told: "Told | None" = None) -> Row:
    """Row of `judged`.  sizes: trials and pieces.  told: what the residual that is left looks like."""
    theta = {k: v.tolist() for k, v in finding.theta[0].items()} if len(finding.theta) == 1 else {}
    return {
        "axis": axis, "subject": subject, "trials": sizes[0], "pieces": sizes[1], "base": finding.base, "final": finding.final,
        "floor": finding.floor, "w2": w2, "h": h, "over": json.dumps(finding.over), "left": ", ".join(finding.left),
        "shapes": ", ".join(finding.shapes), "refused": json.dumps([[r.effects, _plain(r.error), r.reason] for r in finding.refused]),
        "follows": told.follows if told else "", "formulas": json.dumps(told.formulas if told else []), "theta": json.dumps(theta),
        "acts": json.dumps(finding.acts[0] if len(finding.acts) == 1 else {}), "reason": "",
    }  # fmt: skip


class Told(NamedTuple):
    """What a residual looks like: follows, in words; formulas: the two best, in words."""

    follows: str
    formulas: list[str]


def unjudged(axis: str, subject: str, sizes: tuple[int, int], reason: str) -> Row:
    """Row of `judged` where nothing can be said."""
    numbers: Row = dict.fromkeys(("base", "final", "floor", "w2", "h"), float("nan"))
    texts: Row = {
        "over": "{}",
        "left": "",
        "shapes": "",
        "refused": "[]",
        "follows": "",
        "formulas": "[]",
        "theta": "{}",
        "acts": "{}",
        "reason": reason,
    }
    return {"axis": axis, "subject": subject, "trials": sizes[0], "pieces": sizes[1], **numbers, **texts}


def candidates(axis: str, subject: str, finding: Finding, effects: Mapping[str, Effect]) -> Iterator[Row]:
    """Rows of `candidates`: what was found, the largest fall first, then the others by name."""
    about = {"axis": axis, "subject": subject}
    by_name = {c.effect: c for c in finding.candidates}
    found = sorted(finding.found, key=lambda f: f.after - f.before)
    for one in found:
        yield about | _found(one, by_name.get(one.effect, Candidate(one.effect, "found", q=one.q)), effects)
    for candidate in finding.candidates:
        if candidate.effect not in {f.effect for f in found}:
            yield about | _tried(candidate) | {"parameters": _sizes(candidate.effect, candidate.parameters, effects)}


def scaled(rows: Iterator[Row], scale: Scale | None) -> Iterator[Row]:
    """Rows of `candidates`, that of the force scale with what the vertical force says of it.

    It is put right before anything else: each trial has the body mass that its own plates tell.
    """
    for row in rows:
        if scale is not None and row["effect"] == "force_scale" and row["status"] not in ("found", "lacking"):
            each = ", ".join(f"{trial} ({100 * v:+.1f} %)" for trial, v in scale.trials.items())
            said = f"the plates carry more or less than most of the time, taken out of {each}"
            size = {"s": {"value": scale.s[0], "unit": "1", "ci95": [_plain(v) for v in scale.s[1:]]}} if scale.s else {}
            reason = "; ".join(filter(None, (said, row["reason"])))
            row |= {"status": "settled", "parameters": json.dumps(size), "reason": reason}
        yield row


def _found(one: Found, candidate: Candidate, effects: Mapping[str, Effect]) -> Row:
    return _tried(candidate) | {
        "status": "found", "family": ", ".join(one.family), "before": one.before, "after": one.after, "q": one.q,
        "parameters": _sizes(one.effect, one.parameters, effects),
    }  # fmt: skip


def _sizes(effect: str, parameters: Mapping[str, Interval], effects: Mapping[str, Effect]) -> str:
    """Parameters as JSON: name -> value, unit, ci95."""
    units = {p.name: p.unit for p in effects[effect].parameters} if effect else {}
    return json.dumps({k: {"value": v[0], "unit": units.get(k, ""), "ci95": [_plain(v[1]), _plain(v[2])]} for k, v in parameters.items()})


def _tried(c: Candidate) -> Row:
    return {
        "effect": c.effect, "status": c.status, "family": "", "before": float("nan"), "after": c.error, "fall_low": c.low,
        "fall_high": c.high, "q": c.q, "vif": c.vif, "trials_80": c.trials, "parameters": "{}", "reason": c.reason,
    }  # fmt: skip


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


# -- blocks of the verdict --------------------------------------------------------------------------------------------


def block(about: pd.Series, rows: pd.DataFrame, effects: Mapping[str, Effect], model: Sequence[str]) -> Row:
    """What `judged` and `candidates` say of one axis and subject, as keys of the block `plant`; errors in mm.

    about: the row of `judged`.  rows: of `candidates`.  model: effects of the configured model.
    """
    missing = [_entry(row, model) for _, row in rows[rows["status"] == "found"].iterrows()]
    unexplained = bool(about["left"] or about["shapes"])
    refused = json.loads(about["refused"])
    return {
        "final_error_mm": 1e3 * float(about["final"]),
        "missing": missing,
        "unexplained": unexplained,
        "description": describe(about) if unexplained else "",
        "refused": [
            {"effects": names, "error_mm": None if error is None else 1e3 * error, "reason": said} for names, error, said in refused
        ],
        "cannot_judge": {
            r["effect"]: r["reason"].removeprefix("cannot be judged: ") for _, r in rows[rows["status"] == "lacking"].iterrows()
        },
        "separate": list(_separate(missing, rows, effects)),
    }


def _entry(row: pd.Series, model: Sequence[str]) -> Row:
    q = float(row["q"])
    family = str(row["family"]).split(", ")
    return {
        "effect": row["effect"] or None, "family": family, "in_model": row["effect"] in model,
        "error_before_mm": 1e3 * float(row["before"]), "error_after_mm": 1e3 * float(row["after"]),
        "parameters": json.loads(row["parameters"]), "q_value": q if np.isfinite(q) else None,
    }  # fmt: skip


def _separate(missing: Sequence[Row], rows: pd.DataFrame, effects: Mapping[str, Effect]) -> Iterator[str]:
    """What would tell the members of each family apart: another recording, or more trials like these."""
    about = rows.set_index("effect")
    for family in dict.fromkeys(tuple(entry["family"]) for entry in missing if len(entry["family"]) > 1):
        alike = about.loc[[k for k in family[1:] if k in about.index and about.loc[k, "status"] == "alike"]].dropna(subset=["vif"])
        yield separated(family, effects)
        yield from (_more_trials(family[0], str(k), row) for k, row in alike.iterrows())


def _more_trials(effect: str, other: str, row: pd.Series) -> str:
    n = float(row["trials_80"])
    told = f"about {n:.0f} trials like these" if n < MANY else "no number of trials like these"
    return f"{effect} from {other}: {told} would tell them apart with 80 % power (variance inflation {_inflation(float(row['vif']))})"


def _inflation(vif: float) -> str:
    return f"{vif:.3g}" if vif < WHOLLY else f"> {WHOLLY:g}"


def describe(about: pd.Series) -> str:
    """Where something is left and what it looks like, without a cause."""
    over = json.loads(about["over"])
    shapes = [k for k in str(about["shapes"]).split(", ") if k]
    places = [k for k in str(about["left"]).split(", ") if k] or [place(shapes, over)]
    size = {k: f", {over[k]:.1f} times what noise and a model's usual faults give" for k in places if k in str(about["left"])}
    where = " and ".join(f"{WHERE[k]}{size.get(k, '')}" for k in places if k in WHERE)
    formulas = [f.removeprefix("a term like ").removesuffix(", no known effect") for f in json.loads(about["formulas"])]
    like = "; a term like " + ", or like ".join(formulas) if formulas else ""
    like = like or (f"; it looks like {', and '.join(SHAPES[k].title for k in shapes)}" if shapes else "")
    follows = f"; {about['follows']}" if about["follows"] else ""
    return f"in {where}{follows}{like}; no listed effect explains it"


def place(shapes: Sequence[str], over: Mapping[str, float]) -> str:
    """Equation in which shapes stand: a force shows on the kinematic side first."""
    if "moment" not in over:
        return "whole"
    return "kinematic" if any(SHAPES[k].force is not None for k in shapes) else "moment"


def reason(unexplained: bool, named: bool, final: float, floor: float | None) -> str:
    """Why the verdict is what it is.  final, floor: errors [mm]."""
    if unexplained:
        return "structure above the noise is left on trials left out"
    if floor is None:
        rest = (
            "what is named lowers the error on trials left out beyond chance" if named else "no effect lowers the error on trials left out"
        )
        return rest
    return f"{'with what is missing ' if named else ''}held-out error is {final / floor:.2f} of the noise floor"
