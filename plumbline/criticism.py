"""The plant of a study judged: windows with the instruments settled, subject by subject, then all subjects together."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import evidence, findings, outer
from plumbline.effects import HERE as LIBRARY
from plumbline.effects import Catalogue, Effect
from plumbline.evidence import Weak
from plumbline.fit import BOTH, NEITHER, TEST, TRAIN
from plumbline.formulas import formulas, remains
from plumbline.found import Finding
from plumbline.library import channels, library
from plumbline.outer import CONTACT
from plumbline.physics import G
from plumbline.plant import AXES
from plumbline.ranking import LEANS, judge
from plumbline.structure import structure
from plumbline.tables import TABLES, read

Array = NDArray[np.float64]

TRIALS = 2
PIECES = 6
ROUNDS = 4  # times that what is settled is taken out of the channels and found again
NEAR = 0.005  # [1] to which the lever per acceleration is found
ALIKE = 1e-3  # [1] to which the body mass is
BODIES = (0.8, 1.5)  # [1] lever per acceleration in parts of z/g: rigid bodies and people who counter-rotate
LONG = 0.02  # [s] from which on a filter of that delay is told from a delay, see `settled`
WORTH = 0.3  # [1] of the size that matters, from which on a settled effect is taken out


def of_part(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, evaluation: Mapping[str, Any]
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Tables `evidence`, `judged` and `candidates` of whole subjects, each judged alone."""
    plant = plant_effects(effects)
    windows: list[Weak] = []
    rows: list[findings.Row] = []
    tried: list[findings.Row] = []
    for subject in sorted(coverage["subject"].unique()):
        mine = coverage[coverage["subject"] == subject]
        for axis in AXES:
            every, finding = settled(signals, pushes, mine, effects, evaluation, axis)
            windows += every
            got = in_use(every)
            if finding is None:
                rows.append(findings.unjudged(axis, subject, sizes([got]), too_few([got])))
                continue
            told = look(got, finding, signals, mine, effects) if finding.left or finding.shapes else None
            rows.append(findings.judged(axis, subject, finding, sizes([got]), gravity(got), lever(finding, got), told))
            tried += findings.scaled(findings.candidates(axis, subject, finding, plant), _scale([got], plant))
    return evidence.to_table(windows), _table("judged", rows), _table("candidates", tried)


def of_cohort(
    evidence_of: Mapping[str, pd.DataFrame], alone: pd.DataFrame, tried: pd.DataFrame, effects: Catalogue
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `judged` and `candidates` of all subjects, with rows for all of them together (subject `all`).

    evidence_of: subject -> rows of `evidence`; asked for one by one.  alone, tried: the tables of all parts.
    """
    plant = plant_effects(effects)
    rows, more = [alone], [tried]
    for axis in AXES:
        able = alone[(alone["axis"] == axis) & (alone["reason"] == "")]
        if len(able) == 1:
            rows.append(able.assign(subject="all"))
            more.append(tried[(tried["axis"] == axis) & (tried["subject"] == able["subject"].iloc[0])].assign(subject="all"))
        elif len(able):
            each = OneByOne(evidence_of, able["subject"].tolist(), axis)
            finding = together(each, able["h"].tolist(), plant)
            w2 = float(np.mean([gravity(w) for w in each]))
            most = max((findings.Told(r["follows"], json.loads(r["formulas"])) for _, r in able.iterrows()), key=lambda t: len(t.formulas))
            told = most if finding.left or finding.shapes else None
            rows.append(_table("judged", [findings.judged(axis, "all", finding, sizes(each), w2, float(able["h"].mean()), told)]))
            said = findings.scaled(findings.candidates(axis, "all", finding, plant), _scale(each, plant))
            more.append(_table("candidates", list(said)))
        else:
            reasons = alone.loc[alone["axis"] == axis, "reason"]
            why = reasons.iloc[0] if len(reasons) else "no trial could be used"
            rows.append(_table("judged", [findings.unjudged(axis, "all", (0, 0), why)]))
    return pd.concat(rows, ignore_index=True), pd.concat(more, ignore_index=True)


def _scale(each: Sequence[Sequence[Weak]], plant: Mapping[str, Effect]) -> outer.Scale | None:
    """The scale of the plates in the odd trials of some subjects; its size only of a single subject."""
    most = plant["force_scale"].parameters[0].upper if "force_scale" in plant else 0.0
    told = [one for one in (outer.scale(windows, most) for windows in each) if one is not None]
    if len(told) < 2:
        return told[0] if told else None
    return outer.Scale({k: v for one in told for k, v in one.trials.items()}, None)


def plant_effects(effects: Mapping[str, Effect]) -> dict[str, Effect]:
    """Those of the plant ledger that are looked for."""
    return {k: e for k, e in effects.items() if e.ledger == "plant" and e.searched}


def _table(name: str, rows: Sequence[findings.Row]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=[c.name for c in TABLES[name]])


def sizes(each: Sequence[Sequence[Weak]]) -> tuple[int, int]:
    """Trials, and independent pieces of them."""
    return sum(map(len, each)), sum(len(np.unique(w.cluster)) for ws in each for w in ws)


def in_use(windows: Sequence[Weak]) -> list[Weak]:
    """Windows of the trials that the config lets models be fitted to or judged on."""
    return [w for w in windows if w.use != NEITHER]


def too_few(each: Sequence[Sequence[Weak]]) -> str:
    """Why some windows cannot be judged, and what is needed; empty where they can."""
    trials, pieces = sizes(each)
    for use in (TRAIN, TEST):
        if not any(w.use in (use, BOTH) for ws in each for w in ws):
            return f"no trial with a CoM and a ZMP is there to {use} on, as evaluation.{use} of the config asks"
    if trials >= TRIALS and pieces >= PIECES:
        return ""
    return (
        f"{trials} trial{'s' * (trials != 1)} with {pieces} independent piece{'s' * (pieces != 1)} of at most 5 s; "
        f"at least {TRIALS} trials with {PIECES} pieces are needed to leave any out and still tell chance from cause"
    )


def settled(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, evaluation: Mapping[str, Any], axis: str
) -> tuple[list[Weak], Finding | None]:
    """Windows of one subject and axis, what is always fitted taken out of the channels exactly; and what they say, None for too few.

    To first order no motion tells a delay from a filter; where it is long both are tried.
    """
    about = signals, pushes, coverage, effects, evaluation, axis
    windows, finding = _settled(*about, {})
    centre = windows[0].centre if finding is not None else {}
    for name, theta in centre.items():
        for twin in twins(name, effects) if abs(theta[0]) > LONG else ():
            if not twin.parameters[0].refusal(float(theta[0])):
                others, said = _settled(*about, {name: twin.id})
                if said is not None and finding is not None and _asked(said) < _asked(finding):
                    windows, finding = others, said
    return windows, finding


def _asked(finding: Finding) -> tuple[int, int, float]:
    """What a reading of the records leaves and what it needs: of two the lesser is taken."""
    return len(finding.left) + len(finding.shapes), len(finding.found), finding.final


def twins(name: str, effects: Mapping[str, Effect]) -> list[Effect]:
    """The library's effects that no motion tells from one, to first order, and that can be undone with its size."""
    return [e for e in effects.values() if e.twin == name and e.undo is not None and Path(e.file).parent == LIBRARY]


def _settled(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, evaluation: Mapping[str, Any], axis: str,
    read: Mapping[str, str],
) -> tuple[list[Weak], Finding | None]:  # fmt: skip
    """The same with some effects read as others: a delay is known only to first order at a time; taken out and found again, the rest is
    small.
    """
    plant = plant_effects(effects)
    out: dict[str, Array] = {}
    h, finding = 0.0, None
    for _ in range(ROUNDS):
        told = coverage["mass"]
        windows = list(evidence.of_part(signals, pushes, coverage, effects, evaluation, undo=out, read=read, axis=axis))
        used = in_use(windows)
        if too_few([used]):
            return windows, None
        finding = judge([used], plant, [gravity(used)], [h] if h else ())
        before, out = out, _taken(finding, plant)
        last, h = h or LEANS / gravity(used), lever(finding, used)
        coverage = coverage.assign(mass=coverage["trial"].map(outer.masses(used)).fillna(told))
        if not _moved(before, out, plant) and abs(h / last - 1) < NEAR and np.allclose(coverage["mass"], told, rtol=ALIKE, equal_nan=True):
            break
    return windows, finding


def look(
    windows: Sequence[Weak], finding: Finding, signals: pd.DataFrame, coverage: pd.DataFrame, effects: Mapping[str, Effect]
) -> findings.Told:  # fmt: skip
    """What the residual looks like that a finding about one subject leaves, in the equation where most is left."""
    equation = max(finding.left, key=lambda k: finding.over[k]) if finding.left else findings.place(finding.shapes, finding.over)
    w2, h = gravity(windows), lever(finding, windows)
    named = [f.effect for f in finding.found]
    always = [k for k, e in effects.items() if e.settled and k in finding.theta[0]]
    rest, beside = remains(windows, [k for k in dict.fromkeys((*always, *named)) if k in windows[0].terms], w2, equation, h)
    usual = float(np.sqrt(np.mean([w.floor(equation, h) for w in windows])))
    terms = library(channels(windows, signals, coverage, effects))
    said = structure(windows, terms, rest, equation, usual, beside)
    return findings.Told(said.text if said.left else "", [f.text for f in formulas(windows, terms, rest, equation, beside)])


def together(each: Sequence[Sequence[Weak]], h: Sequence[float], plant: Mapping[str, Effect]) -> Finding:
    """What several subjects say on one axis.  each: windows of each, settled.  h: lever per acceleration of each [s2]."""
    return judge(each, plant, [gravity(windows) for windows in each], h)


def lever(finding: Finding, windows: Sequence[Weak]) -> float:
    """Lever per acceleration that a subject's data give, within what a body can be [s2]."""
    return float(np.clip(finding.theta[0]["=h"][0] * gravity(windows), *BODIES)) / gravity(windows)


def gravity(windows: Sequence[Weak]) -> float:
    """g/z of a subject [1/s2]."""
    return G / float(np.mean([w.height for w in windows]))


def _taken(finding: Finding, plant: Mapping[str, Effect]) -> dict[str, Array]:
    """Coefficients that are worth taking out, of a finding about one subject."""
    out = {}
    for name, theta in finding.theta[0].items():
        effect = plant.get(name)
        able = effect is not None and effect.settled and effect.undo is not None
        if effect is None or not able or effect.parameters[0].refusal(float(theta[0])):
            continue
        if abs(theta[0]) > WORTH * effect.parameters[0].matters:
            out[name] = theta
    return out


def _moved(before: Mapping[str, Array], after: Mapping[str, Array], plant: Mapping[str, Effect]) -> bool:
    """Whether what is taken out differs from what was."""
    least = {k: WORTH * plant[k].parameters[0].matters for k in {*before, *after}}
    return any(np.max(np.abs(after.get(k, np.zeros(1)) - before.get(k, np.zeros(1)))) > size for k, size in least.items())


class Shelf(Mapping[str, pd.DataFrame]):
    """Rows of `evidence` of one subject at a time, read when they are asked for."""

    def __init__(self, files: Sequence[str | Path]) -> None:
        self.where = {str(s): f for f in files for s in read("evidence", f, columns=["subject"])["subject"].unique()}

    def __getitem__(self, subject: str) -> pd.DataFrame:
        table = read("evidence", self.where[subject])
        return table[table["subject"] == subject]

    def __iter__(self) -> Iterator[str]:
        return iter(self.where)

    def __len__(self) -> int:
        return len(self.where)


class OneByOne(Sequence[list[Weak]]):
    """Windows of each of some subjects on one axis, made when they are asked for: no more than one subject's are ever in memory."""

    def __init__(self, evidence_of: Mapping[str, pd.DataFrame], subjects: Sequence[str], axis: str) -> None:
        self.evidence_of, self.subjects, self.axis = evidence_of, subjects, axis

    def __getitem__(self, k: Any) -> Any:
        table = self.evidence_of[self.subjects[k]]
        return in_use(list(evidence.from_table(table[table["axis"] == self.axis])))

    def __len__(self) -> int:
        return len(self.subjects)


Sizes = dict[str, dict[str, list[float]]]


class Outside(NamedTuple):
    """A contact beside the plates.  line: of action, the parameters of `push`.  acts: trial -> first and last frame of each time."""

    line: Mapping[str, float]
    acts: Mapping[str, Sequence[tuple[int, int]]]


class Causes(NamedTuple):
    """What was found in each subject's lateral motion, as the control ledger takes it out.

    faults: of records, subject -> effect -> parameters where it can undo itself, else coefficients.  others: the same of what the body
    does besides.  contacts: those beside the plates.
    """

    faults: Sizes
    others: Sizes
    contacts: dict[str, Outside]


def known(judged: pd.DataFrame, tried: pd.DataFrame, effects: Mapping[str, Effect]) -> Causes:
    """What the tables `judged` and `candidates` say that the control ledger needs."""
    faults: Sizes = {}
    others: Sizes = {}
    contacts: dict[str, Outside] = {}
    for _, about in judged[(judged["axis"] == "lateral") & (judged["reason"] == "")].iterrows():
        theta = json.loads(about["theta"])
        rows = tried[(tried["axis"] == "lateral") & (tried["subject"] == about["subject"]) & (tried["status"] == "found")]
        for _, row in rows.iterrows():
            name, values = str(row["effect"]), {k: v["value"] for k, v in json.loads(row["parameters"]).items()}
            if name == CONTACT:
                contacts[about["subject"]] = Outside(values, json.loads(about.get("acts", "{}")))
            if "e0" in values:  # a shift of the CoM is one of the CoP, the other way
                faults.setdefault(about["subject"], {})["offset"] = [-values["e0"]]
            if name not in effects or (name not in theta and name not in ("offset", "tilt")):
                continue
            direct = effects[name].undo is not None or name not in theta
            sizes = [*values.values()] if direct else theta[name]
            (faults if effects[name].recorded else others).setdefault(about["subject"], {})[name] = sizes
    return Causes(faults, others, contacts)
