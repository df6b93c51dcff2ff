"""What became of every effect of the catalogue beside the model that was found."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from plumbline.contest import Case, Need, Refused, Set, beyond, gains, need, trials_for, units
from plumbline.effects import Effect
from plumbline.found import Candidate, Found
from plumbline.search import CLUSTERS, Sums
from plumbline.shapes import SHAPES

Array = NDArray[np.float64]
CONSTANTS = ("offset", "tilt")  # a constant on the moment side, on the kinematic side: judged last, from what is always fitted


def candidates(
    case: Case, members: Set, found: Sequence[Found], needs: Mapping[str, Need], refused: Sequence[Refused],
    absorbed: Mapping[str, str], lacking: Mapping[str, str],
) -> list[Candidate]:  # fmt: skip
    """Every effect with its status; sizes and p-values are those it would have beside the members."""
    out: dict[str, Candidate] = {}
    named = {f.effect: f for f in found}
    family = {k: f.effect for f in found for k in f.family}
    for name, effect in case.effects.items():
        if name in SHAPES or effect.ledger != "plant":
            continue
        if name in named and name in CONSTANTS:
            out[name] = Candidate(name, "found", named[name].after, p=named[name].p)
        elif name in needs:
            status = "found" if name in named else "settled" if name in case.settled else "refused"
            out[name] = _measured(case, members, name, needs[name], status)
        elif name in family:
            out[name] = _rival(case, members, name, family[name])
        elif name in absorbed or effect.twin == "w2":
            out[name] = Candidate(name, "absorbed", reason=absorbed.get(name, "a fitted w2 takes all of it"))
        elif name in case.rivals:
            alike = case.twins[name] & {*members, *case.settled}
            apart = tuple(m for m in members if m not in case.twins[name])
            tried = _measured(case, (*apart, name), name, need(case, (*apart, name), name), "idle")
            out[name] = replace(tried, status="alike", reason=f"stands in for {', '.join(sorted(alike))}") if alike else tried
        else:
            out[name] = Candidate(name, "idle", reason=_untried(effect))
    for one in refused:
        for name in one.effects:
            mine = name in one.reason or len(one.effects) == 1
            if name in out and out[name].status in ("idle", "settled", "refused") and mine:
                out[name] = replace(out[name], status="refused", reason=out[name].reason or one.reason)
    out |= {name: Candidate(name, "lacking", reason=f"cannot be judged: needs {what}") for name, what in lacking.items()}
    return [out[k] for k in sorted(out)]


def _measured(case: Case, members: Set, name: str, needed: Need, status: str) -> Candidate:
    """Error with and without an effect, the fall with its interval from piece to piece."""
    pairs = case.with_and_without(members, name)
    v1 = case.variance([e[:1] for e in pairs])[0, -1]
    falls = units([_falls(s, e) for s, e in zip(case.sums, pairs, strict=True)])
    spread = 1 / len(falls)
    if len(case.sums) < CLUSTERS:  # folds share what they are fitted on, and err together (Nadeau and Bengio 2003, the corrected t)
        spread += float(np.mean([m.sum() / r.sum() for s in case.sums for r, m in s.splits()]))
    half = stdtrit(max(len(falls) - 1, 1), 0.975) * falls.std(ddof=1) * np.sqrt(spread) if len(falls) > 1 else float("inf")
    mean, root = float(falls.mean()), float(np.sqrt(v1))
    low, high = (float(np.sign(v) * (np.sqrt(v1 + abs(v)) - root)) for v in (mean - half, mean + half))
    beside = tuple(n for n in members if n != name)
    share = beyond(case.sums, case.weight, name, beside)
    return Candidate(name, status, root, low, high, needed.p, float("nan"), 1 / max(share, 1e-9), needed.trials)


def _rival(case: Case, members: Set, name: str, best: str) -> Candidate:
    """An effect of the family of one that was found: error with it in its place, and how many trials would tell them apart."""
    out = Candidate(name, "alike", reason=f"these data cannot tell it from {best or 'the others of its family'}")
    if best not in (*members, *case.settled) or name not in (*case.rivals, *case.settled):
        return out  # constants, and what no motion tells apart
    here = (*(n for n in members if n != best), name)
    mine, other = list(case.errors([members])), list(case.errors([here], without=best))
    d = units([gains(case, s, b[0], a[0]) for s, a, b in zip(case.sums, mine, other, strict=True)])
    share = beyond(case.sums, case.weight, name, (*members, best))
    return replace(out, error=float(np.sqrt(case.variance(other)[0, -1])), vif=1 / max(share, 1e-9), trials=trials_for(case, d))


def _falls(s: Sums, errors: Array) -> Array:
    """Fall of the variance in the equation that is reported [m2], trial by trial.  errors: with and without, (2, E, C)."""
    trial = np.unique(s.trial[s.test], return_inverse=True)[1]
    with_it, lacks = (np.bincount(trial, e[s.test]) / np.bincount(trial, s.count[-1, s.test]) for e in errors[:, -1])
    return np.asarray(lacks - with_it)


def _untried(effect: Effect) -> str:
    """Why an effect has no numbers of its own."""
    if effect.id in CONSTANTS:
        return "told by a constant: none that is large enough"
    if effect.twin:
        return f"no motion tells it from {effect.twin}"
    return "no contact is seen that the plates miss"
