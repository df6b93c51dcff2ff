"""Which effects are missing: sets of effects compete in predicting trials left out; each named one must be needed, large and possible."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from plumbline.effects import Effect
from plumbline.evidence import Weak
from plumbline.physics import G
from plumbline.search import Fit, Sums, fit, heldout, residual_variance, solve, subsets, sums
from plumbline.shapes import SHAPES

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Set = tuple[str, ...]

MOST = 3  # effects and shapes searched at once beside those that are always fitted
FALL = 0.06  # [1] log of the ratio of variances, summed over the equations, that an effect must bring on trials left out
SHARE = 0.25  # [1] of the noise floor by which it must lower the rms
SURE = 0.05  # [1] false discovery rate over the catalogue
TWINS = 0.97  # [1] correlation of what two effects add beyond the base, from which on these data cannot tell them apart
ABSORBED = 0.995  # [1] share of an effect that the base takes
FAULT = 0.005  # [1] of the motion that a segment table and rigid segments leave in any study
LEFT = 1.35  # [1] residual over noise floor and that, above which something is left
PLAIN = 2.0  # [1] fall of the score that an effect must bring to be named where something is left that nobody explains
MODEL = 0.01  # [1] of the paper's error that a model may leave before it is worth a word
SPARED = 0.3  # [1] of the tolerance that is added before variances are compared
APART = (("gain", "hand"), ("force_scale", "hand"), ("gain", "com_bias"), ("force_scale", "com_bias"), ("gain", "force_scale"))
"""Pairs that these equations cannot tell from a common factor of both sides."""
LOAD = 0.02  # [1] of body weight that must be missing on the plates before a contact that no plate measures is thought of
CONSTANTS = ("offset", "tilt")  # a constant on the moment side, on the kinematic side


@dataclass(frozen=True)
class Found:
    """One effect that the data want.

    values, low, high: parameters with 95 % intervals, (k,).  before, after: held-out error without and with it [m].
    p: of no fall.  q: the same, false discovery rate over the catalogue.
    """

    effect: str
    family: tuple[str, ...]
    values: Array
    low: Array
    high: Array
    before: float
    after: float
    p: float
    q: float


@dataclass(frozen=True)
class Refused:
    """An effect or set that would lower the error and was not believed, with the reason."""

    effects: Set
    error: float
    reason: str


@dataclass(frozen=True)
class Finding:
    """What the data of one subject (or of several, pooled) say on one axis.

    found: effects.  shapes: shapes without a cause that the residual needs.  refused: impostors.  absorbed: effect -> what takes it.
    lacking: effect -> channels that are missing.  base, final: held-out error of the paper's equation and of the last model [m].
    floor: what sensor noise gives [m], NaN where not known.  over: equation -> residual over noise floor and usual faults.
    left: the equations in which more is left than noise and a model's usual faults explain; empty where the floor is not known.
    """

    found: Sequence[Found] = ()
    shapes: Set = ()
    refused: Sequence[Refused] = ()
    absorbed: Mapping[str, str] = field(default_factory=dict)
    lacking: Mapping[str, str] = field(default_factory=dict)
    base: float = float("nan")
    final: float = float("nan")
    floor: float = float("nan")
    over: Mapping[str, float] = field(default_factory=dict)
    left: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Case:
    """Sums of each subject with what is fitted always, what competes, and the weights of the equations."""

    sums: Sequence[Sums]
    effects: Mapping[str, Effect]
    settled: Set
    rivals: Set
    weight: Array
    twins: Mapping[str, set[str]]


def judge(windows: Sequence[Sequence[Weak]], effects: Mapping[str, Effect], w2: Sequence[float]) -> Finding:
    """Judge the plant of some subjects on one axis.

    windows: of each subject.  effects: the catalogue.  w2: base model of each subject [1/s2].
    """
    lacking = {k: v for ws in windows for w in ws for k, v in w.lacking.items() if k not in SHAPES}
    every = {k: e for k, e in {**effects, **SHAPES}.items() if all(k in w.terms for ws in windows for w in ws)}
    load = max(float(np.sqrt(np.nanmean(w.vertical**2))) for ws in windows for w in ws)
    idle = {"push"} if load < LOAD * G else set()
    offered = [k for k in every if k not in CONSTANTS and k not in idle]
    all_sums = [sums(ws, offered, w) for ws, w in zip(windows, w2, strict=True)]
    case, absorbed = _case(all_sums, every, offered)
    best, refused = _search(case)
    members = _pruned(case, best)
    return _finding(case, members, refused, absorbed, lacking)


# -- what competes ----------------------------------------------------------------------------------------------------


def _case(all_sums: Sequence[Sums], every: Mapping[str, Effect], offered: Sequence[str]) -> tuple[_Case, dict[str, str]]:
    nuisance = tuple(k for k in offered if every[k].settled)
    weight = np.mean([1.0 / _tolerance(s) for s in all_sums], axis=0) * _judged(all_sums[0])
    alone = {k: _beyond(all_sums, weight, k) for k in offered}
    absorbed = {k: "a fitted w2 takes all of it" for k, left in alone.items() if left < 1 - ABSORBED}
    rivals = tuple(k for k in alone if k not in absorbed and k not in nuisance)
    twins = _twins(all_sums, weight, (*nuisance, *rivals))
    for a, b in APART:
        if a in twins and b in twins:
            twins[a].add(b)
            twins[b].add(a)
    return _Case(all_sums, every, nuisance, rivals, weight, twins), absorbed


def _judged(s: Sums) -> Array:
    """1 for the equations that decide, 0 for the others."""
    return np.array([1.0 if len(s.equations) == 1 or e != "whole" else 0.0 for e in s.equations])


def _tolerance(s: Sums) -> Array:
    """Variance that is not worth a word in each equation, (E,): sensor noise, and MODEL of what the paper's equation leaves.

    The moment side is not trusted beyond what the kinematic side is worth as ZMP: a parameter that stands in both is the latter's to tell.
    """
    base = residual_variance(s, _judged(s) / np.maximum(s.square.sum(1) / s.count.sum(1), 1e-30), s.of(()))
    floor = np.nan_to_num(np.sum(s.floor * s.count, axis=1) / s.count.sum(1))
    out = np.maximum(floor, MODEL**2 * base + 1e-30)
    if "kinematic" in s.equations:
        k, m = s.equations.index("kinematic"), s.equations.index("moment")
        out[m] = max(out[m], out[k] / s.w2**2)
    return np.asarray(out)


def _projected(s: Sums, weight: Array, base: Index, mine: Index) -> Array:
    """Gram of some columns after the base is taken out, (k, k)."""
    g = np.einsum("e,ecij->ij", weight, s.gram)
    inner = g[np.ix_(base, mine)]
    gain = np.stack([solve(g[np.ix_(base, base)], inner[:, k]) for k in range(len(mine))], axis=1)
    return np.asarray(g[np.ix_(mine, mine)] - inner.T @ gain)


def _own(s: Sums, name: str) -> Index:
    return np.flatnonzero([n == name for n, _ in s.columns])


def _beyond(all_sums: Sequence[Sums], weight: Array, name: str) -> float:
    """Largest share of an effect's columns that the base does not take."""
    shares = []
    for s in all_sums:
        mine = _own(s, name)
        whole = np.einsum("e,ecij->ij", weight, s.gram)[mine, mine]
        left = np.diag(_projected(s, weight, s.of(()), mine))
        shares.append(max((a / b for a, b in zip(left, whole, strict=True) if b > 0), default=0.0))
    return float(np.mean(shares))


def _twins(all_sums: Sequence[Sums], weight: Array, names: Set) -> dict[str, set[str]]:
    """Effects of one column whose signatures beyond the base are the same in these data."""
    single = [k for k in names if sum(n == k for n, _ in all_sums[0].columns) == 1]
    out: dict[str, set[str]] = {k: set() for k in names}
    total = np.zeros((len(single), len(single)))
    for s in all_sums:
        g = _projected(s, weight, s.of(()), np.array([_own(s, k)[0] for k in single], int)) if single else total
        d = np.sqrt(np.maximum(np.diag(g), 1e-30))
        total = total + np.abs(g / np.outer(d, d)) / len(all_sums)
    for i, a in enumerate(single):
        out[a] |= {b for j, b in enumerate(single) if i != j and total[i, j] > TWINS}
    return out


def _columns(case: _Case, s: Sums, names: Set, without: str = "") -> Index:
    """Columns of a model: the base, what is fitted always and cannot be mistaken for a member, the members."""
    always = [k for k in case.settled if k != without and not case.twins[k] & set(names)]
    return s.of((*always, *names))


# -- the search -------------------------------------------------------------------------------------------------------


def _errors(case: _Case, sets: Sequence[Set]) -> list[Array]:
    """Sum of squares on trials left out of each subject: (S, E, C)."""
    return [heldout(s, case.weight, [_columns(case, s, names) for names in sets]) for s in case.sums]


def _without(case: _Case, names: Set, name: str) -> list[Array]:
    """The same for a model and for what is left of it without one of its effects, (2, E, C)."""
    few = tuple(n for n in names if n != name)
    return [heldout(s, case.weight, [_columns(case, s, names), _columns(case, s, few, without=name)]) for s in case.sums]


def _variance(case: _Case, errors: Sequence[Array]) -> Array:
    """Pooled held-out variance of each set and equation, (S, E)."""
    count = sum(s.count.sum(1) for s in case.sums)
    return np.asarray(sum(e.sum(2) for e in errors) / count)


def _score(case: _Case, variance: Array) -> Array:
    """Log variance summed over the equations that decide, a part of the tolerance added: what is below it does not count, (S,)."""
    use = case.weight > 0
    return np.asarray(np.log(np.maximum(variance[:, use], 0.0) + SPARED / case.weight[use]).sum(1))


def _search(case: _Case) -> tuple[Set, list[Refused]]:
    """The set with the least score, counting FALL for each member, and the sets that would be better but cannot be."""
    sets = subsets(case.rivals, min(MOST, len(case.rivals)), case.twins)
    variance = _variance(case, _errors(case, sets))
    score = _score(case, variance) + FALL * np.array([len(names) for names in sets])
    refused: list[Refused] = []
    for k in np.argsort(score, kind="stable"):
        reason = _impossible(case, sets[k])
        if not reason:
            return sets[k], refused
        if len(refused) < 5:
            refused.append(Refused(sets[k], float(np.sqrt(variance[k, -1])), reason))
    return (), refused


def _impossible(case: _Case, names: Set) -> str:
    """Why a set cannot be: a parameter that is not physically possible in the middle of the subjects."""
    fits = [_fit(case, s, names) for s in case.sums]
    for name in names:
        if name not in SHAPES:
            effect = case.effects[name]
            values = np.median([_values(case, s, f, name) for s, f in zip(case.sums, fits, strict=True)], axis=0)
            for parameter, value in zip(effect.parameters, values, strict=False):
                said = parameter.refusal(float(value))
                if said:
                    return f"{name}: {said}"
    return ""


def _fit(case: _Case, s: Sums, names: Set) -> Fit:
    return fit(s, case.weight, _columns(case, s, names))


def _values(case: _Case, s: Sums, f: Fit, name: str) -> Array:
    theta, _ = f.of(s, name)
    return case.effects[name].of_coefficients(theta, _constant(s, f))


def _constant(s: Sums, f: Fit) -> float:
    """Constant of the kinematic side [N]."""
    return float(f.of(s, "=kinematic")[0][0]) * s.mass


# -- what is needed ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Need:
    """What an effect brings: fall of the score, p of none, largest fall of an equation's rms as ZMP in units of the whole floor."""

    fall: float
    p: float
    share: float


def _need(case: _Case, names: Set, without: str) -> _Need:
    """Compare a model with the same without one of its effects."""
    pairs = _without(case, names, without)
    with_it, lacks = [e[0] for e in pairs], [e[1] for e in pairs]
    v1, v0 = (_variance(case, [e[None] for e in errors])[0] for errors in (with_it, lacks))
    fall = float(_score(case, v0[None])[0] - _score(case, v1[None])[0])
    use = case.weight > 0
    d = np.concatenate([_gains(case, s, a, b) for s, a, b in zip(case.sums, lacks, with_it, strict=True)])
    n = len(d)
    t = d.mean() / (d.std(ddof=1) / np.sqrt(n) + 1e-300) if n > 1 else 0.0
    fell = (np.sqrt(np.maximum(v0, 0)) - np.sqrt(np.maximum(v1, 0))) * _as_zmp(case)
    floor = _floor(case)[-1]
    known = floor if np.isfinite(floor) else float(np.sqrt(max(v1[-1], 0.0)))
    return _Need(fall, float(stdtr(max(n - 1, 1), -t)), float(np.max(fell[use]) / known))


def _as_zmp(case: _Case) -> Array:
    """What an error of each equation is worth as ZMP, (E,): [s2] for accelerations, [1] for lengths; the vertical counts nothing."""
    s = case.sums[0]
    worth = {"kinematic": 1.0 / s.w2, "vertical": 0.0}
    return np.array([worth.get(e, 1.0) for e in s.equations])


def _gains(case: _Case, s: Sums, lacks: Array, with_it: Array) -> Array:
    """Score that each independent piece gains, as logs: no single piece outvotes the others."""
    use, label = case.weight > 0, _label(s)
    out = np.zeros(label.max() + 1)
    for e in np.flatnonzero(use):
        count = np.bincount(label, s.count[e])
        a, b = (np.maximum(np.bincount(label, v[e]) / count, 0.0) + SPARED / case.weight[e] for v in (lacks, with_it))
        out += np.log(a / b)
    return out


def _label(s: Sums) -> Index:
    """What is independent: trials; pieces where there are fewer than six trials."""
    return s.trial if len(s.trials) >= 6 else np.arange(len(s.trial))


def _floor(case: _Case) -> Array:
    """Rms that sensor noise gives in each equation, (E,)."""
    total = sum((s.floor * s.count).sum(1) for s in case.sums)
    return np.asarray(np.sqrt(total / sum(s.count.sum(1) for s in case.sums)))


def _pruned(case: _Case, names: Set) -> Set:
    """Members that are needed beside each other, the least needed taken out first."""
    while names:
        needs = {n: _need(case, names, n) for n in names}
        worst = min(names, key=lambda n: needs[n].fall)
        idle = [n for n in names if not _enough(needs[n])]
        if not idle:
            return names
        names = tuple(n for n in names if n != (worst if worst in idle else idle[0]))
    return names


def _enough(need: _Need) -> bool:
    return need.fall > FALL and need.p < SURE and need.share > SHARE


# -- what is said -----------------------------------------------------------------------------------------------------


def _finding(case: _Case, members: Set, refused: Sequence[Refused], absorbed: Mapping[str, str], lacking: Mapping[str, str]) -> Finding:
    named = [n for n in members if n not in SHAPES] + [n for n in case.settled if _matters(case, members, n)]
    variance = _variance(case, _errors(case, [members, ()]))
    floor = float(_floor(case)[-1])
    usual = np.sqrt(_floor(case) ** 2 + (FAULT * _signal(case)) ** 2)
    over = dict(zip(case.sums[0].equations, (np.sqrt(np.maximum(variance[0], 0.0)) / usual).tolist(), strict=True))
    decide = [e for e, w, z in zip(over, case.weight, _as_zmp(case), strict=True) if w * z > 0]
    left = tuple(e for e in decide if over[e] > LEFT)
    shapes = tuple(n for n in members if n in SHAPES)
    if left or shapes:  # what nobody explains may look like any effect a little
        doubtful = [n for n in named if _need(case, members, n).fall < PLAIN]
        refused = [*refused, *(Refused((n,), float("nan"), "small beside what nobody explains") for n in doubtful)]
        named = [n for n in named if n not in doubtful]
    return Finding(
        [_found(case, members, name) for name in named], shapes, refused, absorbed, lacking,
        float(np.sqrt(variance[1, -1])), float(np.sqrt(variance[0, -1])), floor, over, left,
    )  # fmt: skip


def _signal(case: _Case) -> Array:
    """Rms of what each equation is about, (E,): the acceleration of the CoM, or its lever over the ZMP; 0 for the vertical."""
    s = case.sums[0]
    count = sum(x.count.sum(1) for x in case.sums)
    lever = np.sqrt(sum(x.square.sum(1) for x in case.sums) / count)
    force = np.sqrt(sum(x.gram[:, :, 3, 3].sum(1) for x in case.sums) / count)
    names = list(s.equations)
    of = {"kinematic": force[names.index("moment")] if "moment" in names else 0.0, "vertical": 0.0}
    return np.array([of.get(e, lever[k]) for k, e in enumerate(names)])


def _matters(case: _Case, members: Set, name: str) -> bool:
    """Whether something that is fitted always deserves a name: large enough, and needed."""
    if case.twins[name] & set(members):
        return False
    value = np.median([_values(case, s, _fit(case, s, members), name)[0] for s in case.sums])
    return bool(abs(value) >= case.effects[name].parameters[0].matters) and _enough(_need(case, members, name))


def _found(case: _Case, members: Set, name: str) -> Found:
    need = _need(case, members, name)
    fits = [_fit(case, s, members) for s in case.sums]
    values = np.median([_values(case, s, f, name) for s, f in zip(case.sums, fits, strict=True)], axis=0)
    half = _reach(case, case.sums[0], fits[0], name)
    after, before = _variance(case, _without(case, members, name))[:, -1]
    return Found(name, (name,), values, values - half, values + half, float(np.sqrt(before)), float(np.sqrt(after)), need.p, need.p)


def _reach(case: _Case, s: Sums, f: Fit, name: str) -> Array:
    """Half of the 95 % interval of each parameter, the covariance carried through to them."""
    theta, covariance = f.of(s, name)
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    at = case.effects[name].of_coefficients(theta, _constant(s, f))
    slopes = []
    for k in range(len(theta)):
        step = np.where(np.arange(len(theta)) == k, sd[k], 0.0)
        slopes.append((case.effects[name].of_coefficients(theta + step, _constant(s, f)) - at) / sd[k])
    jacobian = np.stack(slopes, axis=1)
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return np.asarray(float(stdtrit(max(f.clusters - 1, 1), 0.975)) * np.sqrt(np.maximum(variance, 0.0)))
