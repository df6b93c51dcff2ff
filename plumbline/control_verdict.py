"""What the table `control` says: the block `control` of the verdict.

The search is greedy: of all effects beside the law found so far that one is added which gains most log likelihood on trials left out,
summed over subjects, if it gains enough to count and to matter. Effects that gain as much but for what chance gives are its family.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import chdtrc

from plumbline.control_shapes import SHAPES
from plumbline.effects import HERE as LIBRARY
from plumbline.effects import Effect, catalogue
from plumbline.effects_text import separated
from plumbline.false_discovery import false_discovery_rate

Array = NDArray[np.float64]

COUNTS = 8.0  # log likelihood on trials left out that an effect must gain, also without the trial in which it gains most
MATTERS = 0.015  # share that it must take off the score, and off the geometric mean of the errors of CoM and ZMP
SHAPED = 25.0  # log likelihood that a shape without a cause must gain
FALLS = 0.05  # share that it must take off the error of the simulated CoM
TIE = 20.0  # log likelihood within which two effects cannot be told apart, or
TIE_SHARE = 0.05  # of what the better one gains: no law is right to more than that
SPREAD = 2.0  # variance of twice the log likelihood gained over that of the textbook: blocks of noise are not quite independent
LEVEL = 0.01  # false discoveries among those named


def judge(
    table: pd.DataFrame, model: Sequence[str] = (), effects: Mapping[str, Effect] | None = None, *, settled: bool = True
) -> dict[str, Any]:
    """The block `control` of `verdict.json` from rows of the table `control`: all subjects, or those of one.

    model: effects of the configured model.  effects: the catalogue, default the library's.  settled: False where the plant ledger has
    something left that no effect explains: a force from outside would pass for a late law, so that nothing is named then.
    """
    known = {**SHAPES, **(effects if effects is not None else catalogue())}
    rows = table[table["reason"] == ""]
    if rows.empty:
        said = sorted(set(table["reason"]))
        return _unjudged(said[0] if said else "no task `lateral` with loci: the controller is judged on returns from pushes there")
    sums = _Sums(rows[rows["mode"] == "loop"])
    missing, found, left = _missing(sums, _Sums(rows[rows["mode"] == "frame"]), known, model)
    best = _joined(found, left.effect) if left else found
    wanted = "+".join(sorted(set(model) & {n for n, e in known.items() if e.ledger == "control"}))
    block = {
        "base_error_mm": sums.error(""), "model_error_mm": sums.error(wanted), "final_error_mm": sums.error(found),
        "noise_floor_mm": sums.error(best, "fitted_square_sum"), "missing": missing, "unexplained": left is not None,
        "description": _described(left, sums, found, known) if left else "", "reason": _reason(missing, sums, found),
        "cannot_judge": dict(_not_judged(known, sums)),
        "separate": [separated(m["family"], known) for m in missing if len(m["family"]) > 1],
    }  # fmt: skip
    return block if settled or not (missing or left) else block | UNSETTLED


def _not_judged(known: Mapping[str, Effect], sums: "_Sums") -> Iterator[tuple[str, str]]:
    """Effects of the law that were not tried, and what they need."""
    tried = {n for name in sums.names for n in name.split("+")}
    for name, effect in known.items():
        if effect.ledger == "control" and not effect.law:
            yield name, f"needs {', '.join(effect.needs)}"
        elif effect.ledger == "control" and name not in tried and effect.file and Path(effect.file).parent != LIBRARY:
            yield name, "needs its file to be put right: its law cannot be simulated, results/logs/control says why"


UNSETTLED: dict[str, Any] = {
    "missing": None, "unexplained": None, "description": "", "separate": [],
    "reason": "not judged: the plant equation lacks something that no effect explains, and it would pass for a fault of the law",
}  # fmt: skip


def _missing(
    sums: "_Sums", frame: "_Sums", known: Mapping[str, Effect], model: Sequence[str]
) -> tuple[list[dict[str, Any]], str, "_Step | None"]:
    """The entries of `missing`, the candidate that has them all, and the shape that is left, if any."""
    missing: list[dict[str, Any]] = []
    found, left = "", None
    at_once = _step(frame, "", known, {})
    twins: dict[str, float] = {}  # effect -> log likelihood that it must gain beside what it is confounded with
    while step := at_once or _step(sums, found, known, twins):
        if step.effect in SHAPES:
            left = step
            break
        after = _joined(found, step.effect)
        missing.append({
            "effect": step.effect, "family": step.family, "in_model": step.effect in model, "error_before_mm": sums.error(found),
            "error_after_mm": sums.error(after), "parameters": {}, "q_value": step.q,
        })  # fmt: skip
        found = after
        like = {*step.family, *known[step.effect].confounded, *(n for n, e in known.items() if step.effect in e.confounded)}
        twins |= dict.fromkeys(like, max(TIE, TIE_SHARE * step.gain))
        if at_once:  # beside a framewise effect no other can be judged: only noise leads through its zones
            break
    parameters = (frame if at_once else sums).parameters(found)
    for entry in missing:
        entry["parameters"] = parameters.get(entry["effect"], {})
    return missing, found, left


def trials(table: pd.DataFrame, names: Sequence[str]) -> tuple[Array, Array]:
    """Sum of squares of the simulated against the measured CoM [m2] and frames of each trial left out, with some effects in the law."""
    rows = table[(table["reason"] == "") & (table["mode"] == "loop")]
    sums, candidate = _Sums(rows), "+".join(sorted(names))
    return sums.column(candidate, "square_sum"), sums.column(candidate, "frames")


def _unjudged(reason: str) -> dict[str, Any]:
    """The block where nothing can be said."""
    errors: dict[str, Any] = dict.fromkeys(("base_error_mm", "model_error_mm", "final_error_mm", "noise_floor_mm"))
    return errors | {"missing": None, "unexplained": None, "description": "", "reason": reason, "cannot_judge": {}, "separate": []}


def _described(left: "_Step", sums: "_Sums", found: str, known: Mapping[str, Effect]) -> str:
    """What the shapes say that fit best, in words."""
    said = []
    for name in left.family[:2]:
        sizes = sums.parameters(_joined(found, name)).get(name, {})
        values = ", ".join(f"{k} = {v['value']:.3g} {v['unit']}" for k, v in sizes.items())
        said.append(f"{known[name].title} (p gets {known[name].equation}, {values})")
    share = 100 * (1 - sums.error(_joined(found, left.effect)) / sums.error(found))
    shapes = "; or ".join(said)
    return f"in the control residual something like: {shapes}; {share:.0f} % off the error of the CoM; no listed effect explains it"


def _joined(found: str, name: str) -> str:
    return "+".join(sorted([*filter(None, found.split("+")), name]))


def _reason(missing: Sequence[Mapping[str, Any]], sums: "_Sums", found: str) -> str:
    floor = "the floor is the error of the CoM that noise of the feedback makes under the best law found"
    if not missing:
        return f"no effect predicts trials left out enough better than the base law; {floor}"
    share = 1 - sums.score(found).sum() / sums.score("").sum()
    names = " and ".join(" or ".join(m["family"]) for m in missing)
    return f"{names} takes {100 * share:.0f} % off the ZMP's squared error on trials left out, freed of its colour; {floor}"


class _Sums:
    """Sums over a table's rows by candidate; a group that lacks a candidate counts with the best subset that it has."""

    def __init__(self, rows: pd.DataFrame) -> None:
        each = rows.groupby(["subject", "task", "condition"])
        self.groups = {key: {str(n): one for n, one in g.groupby("candidate")} for key, g in each}
        self.mode = str(rows["mode"].iloc[0])
        self.names = sorted({name for g in self.groups.values() for name in g})

    def _of(self, group: Mapping[str, pd.DataFrame], candidate: str) -> pd.DataFrame:
        if candidate in group:
            return group[candidate]
        wanted = set(candidate.split("+"))
        return min((g for n, g in group.items() if set(filter(None, n.split("+"))) < wanted), key=lambda g: float(g["score"].sum()))

    def column(self, candidate: str, name: str) -> Array:
        """A column by trial."""
        return np.concatenate([self._of(g, candidate)[name].to_numpy(float) for g in self.groups.values()])

    def score(self, candidate: str) -> Array:
        """Sum of squared whitened errors by trial."""
        return self.column(candidate, "score")

    def error(self, candidate: str, name: str = "square_sum") -> float:
        """Rms of the simulated against the measured CoM [mm]."""
        return 1e3 * float(np.sqrt(self.column(candidate, name).sum() / self.column(candidate, "frames").sum()))

    def misfit(self, candidate: str) -> float:
        """Geometric mean of the rms errors of CoM and ZMP [mm]."""
        return float(np.sqrt(self.error(candidate) * self.error(candidate, "zmp_square_sum")))

    def sizes(self, candidate: str) -> int:
        """Parameters of the effects, over all groups."""
        return sum(int(self._of(g, candidate)["sizes"].iloc[0]) for g in self.groups.values())

    def refused(self, candidate: str) -> bool:
        """Whether in most groups an effect is too small to matter or at its bound."""
        return bool(np.mean([bool(self._of(g, candidate)["refused"].iloc[0]) for g in self.groups.values()]) > 0.5)

    def parameters(self, candidate: str) -> dict[str, dict[str, Any]]:
        """effect -> parameter -> value, unit, ci95: the median of the groups and of their intervals' ends."""
        each = [json.loads(self._of(g, candidate)["parameters"].iloc[0]) for g in self.groups.values()]
        out: dict[str, dict[str, Any]] = {}
        for effect in {e for one in each for e in one}:
            out[effect] = {}
            for name, first in next(one[effect] for one in each if effect in one).items():
                have = [one[effect][name] for one in each if effect in one]
                ends = [h["ci95"] for h in have if h["ci95"]]
                value = float(np.median([h["value"] for h in have]))
                interval = [float(v) for v in np.median(ends, axis=0)] if ends else None
                out[effect][name] = {"value": value, "unit": first["unit"], "ci95": interval}
        return out


class _Step(NamedTuple):
    """The effect to add, its family with itself first, the log likelihood that it gains, its q value."""

    effect: str
    family: list[str]
    gain: float
    q: float


def _step(sums: _Sums, found: str, known: Mapping[str, Effect], twins: Mapping[str, float]) -> _Step | None:
    """What to add to the effects found; None where nothing counts."""
    now, have = sums.score(found), set(filter(None, found.split("+")))
    gains: dict[str, float] = {}
    sure: dict[str, float] = {}  # gained without the best trial: one trial of odd noise outvotes the others
    for name in sums.names:
        more = set(name.split("+")) - have if name else set()
        if len(more) == 1 and have < set(name.split("+")) and (sums.mode == "loop" or _framewise(known[min(more)])):
            new = more.pop()
            each = (now - sums.score(name)) / 2
            gains[new], sure[new] = float(each.sum()), float(each.sum() - each.max())
    q = false_discovery_rate({n: _p_value(g, sums.sizes(_joined(found, n)) - sums.sizes(found)) for n, g in gains.items()})
    least = {n: max(COUNTS, twins.get(n, 0.0), MATTERS * now.sum() / 2, SHAPED if n in SHAPES else 0.0) for n in gains}
    able = [n for n, g in gains.items() if g > least[n] and sure[n] > COUNTS and q[n] < LEVEL]
    good = {n: gains[n] for n in able if _matters(sums, found, _joined(found, n))}
    if not good:
        return None
    most = max(good.values())
    tie = max(TIE, TIE_SHARE * most)
    best = max(good, key=lambda n: good[n] + (-tie if n in SHAPES else max(t.odds for t in known[n].law)))
    like = [n for n in good if n != best and good[n] > most - tie and (n in SHAPES) == (best in SHAPES)]
    return _Step(best, [best, *sorted(like, key=lambda n: -good[n])], good[best], q[best])


def _framewise(effect: Effect) -> bool:
    return any(t.framewise for t in effect.law)


def _matters(sums: _Sums, found: str, after: str) -> bool:
    """Whether the sizes are possible, not too small, and the errors fall; frame by frame: whether it counts beside other effects too."""
    if sums.refused(after):
        return False
    if sums.mode == "loop":
        return sums.misfit(after) < (1 - MATTERS) * sums.misfit(found) and sums.error(after) < (1 - FALLS) * sums.error(found)
    beside = [(n, _joined(n, after)) for n in sums.names if n and after not in n.split("+")]
    alone = sums.score(after).sum()
    return all(sums.score(a).sum() - min(sums.score(b).sum(), alone) > 2 * COUNTS for a, b in beside if b in sums.names)


def _p_value(gain: float, sizes: int) -> float:
    return float(chdtrc(max(sizes, 1), max(2 * gain / SPREAD, 0.0)))
