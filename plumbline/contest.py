"""Sets of effects compete in predicting trials left out: what competes, how sets are scored, what each member brings."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from plumbline.effects import Effect
from plumbline.search import CLUSTERS, Fit, Sums, fit, heldout, residual_variance, solve, subsets
from plumbline.shapes import BESIDE, PLACED, SHAPES

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Set = tuple[str, ...]

MOST = 3  # effects and shapes searched at once beside those that are always fitted
FALL = 0.06  # [1] log of the ratio of variances, summed over the equations, that an effect must bring on trials left out
SHARE = 0.25  # [1] of what noise and a model's usual faults leave, by which it must lower the rms
SURE = 0.05  # [1] p of no such effect, beside the fall and the size that are asked for; q over the catalogue comes on top
REFUSED = 5  # impostors that are told
TWINS = 0.97  # [1] correlation of what two effects add beyond the base, from which on these data cannot tell them apart
ABSORBED = 0.995  # [1] share of an effect that the base takes
MODEL = 0.01  # [1] of the paper's error that a model may leave before it is worth a word
SPARED = 0.3  # [1] of the tolerance that is added before variances are compared
CONSTANT = ("=kinematic", "=moment", "=vertical")
APART = (("gain", "hand"), ("force_scale", "hand"), ("gain", "com_bias"), ("force_scale", "com_bias"), ("gain", "force_scale"))
"""Pairs that these equations cannot tell from a common factor of both sides."""


@dataclass(frozen=True)
class Refused:
    """An effect or set that would lower the error and was not believed, with the reason."""

    effects: Set
    error: float
    reason: str


@dataclass(frozen=True)
class Case:
    """Sums of each subject with what is fitted always, what competes, and the weights of the equations.

    faults: rms that a segment table and rigid segments leave in each equation of any study, (E,).
    """

    sums: Sequence[Sums]
    effects: Mapping[str, Effect]
    settled: Set
    rivals: Set
    weight: Array
    twins: Mapping[str, set[str]]
    faults: Array

    # -- scores of sets ---------------------------------------------------------------------------------------------------

    def columns(self, s: Sums, names: Set, without: str = "") -> Index:
        """Columns of a model: the base, what is fitted always and cannot be mistaken for a member, the members."""
        always = [k for k in self.settled if k != without and not self.twins[k] & set(names)]
        return s.of((*always, *names))

    def left_out(self, names: Set, silent: Set) -> float:
        """Held-out error of the last equation [m] with some effects and nothing else beside the base.  silent: fitted and not used."""
        return float(np.sqrt(self.variance([heldout(s, self.weight, [s.of(names)], silent=own(s, *silent)) for s in self.sums])[0, -1]))

    def errors(self, sets: Sequence[Set], *, without: str = "") -> Iterator[Array]:
        """Sum of squares on trials left out of each subject, one after the other: (S, E, C).

        without: what is not fitted this time.
        """
        return (heldout(s, self.weight, [self.columns(s, names, without) for names in sets]) for s in self.sums)

    def with_and_without(self, names: Set, name: str) -> list[Array]:
        """The same for a model and for what is left of it without one of its effects, (2, E, C)."""
        few = tuple(n for n in names if n != name)
        return [heldout(s, self.weight, [self.columns(s, names), self.columns(s, few, without=name)]) for s in self.sums]

    def variance(self, errors: Iterable[Array]) -> Array:
        """Pooled held-out variance of each set and equation, (S, E)."""
        return np.asarray(np.maximum(sum(e.sum(2) for e in errors) / sum(s.judged for s in self.sums), 0.0))

    def inside(self, names: Set) -> Array:
        """Pooled variance at the fits over all trials, (E,)."""
        total = sum(residual_variance(s, self.weight, self.columns(s, names)) * s.count.sum(1) for s in self.sums)
        return np.asarray(total / sum(s.count.sum(1) for s in self.sums))

    def score(self, variance: Array) -> Array:
        """Log variance summed over the equations that decide, a part of the tolerance added: what is below it does not count, (S,)."""
        use = self.weight > 0
        return np.asarray(np.log(variance[:, use] + SPARED / self.weight[use]).sum(1))

    # -- fits -------------------------------------------------------------------------------------------------------------

    def fit(self, s: Sums, names: Set) -> Fit:
        """Coefficients of a model for one subject."""
        return fit(s, self.weight, self.columns(s, names))

    def parameters(self, s: Sums, f: Fit, name: str) -> Array:
        """Parameters of an effect in a fit."""
        return self.effects[name].of_coefficients(f.of(s, name)[0], constant(s, f))

    def middle(self, names: Set, name: str) -> Array:
        """Parameters of an effect, in the middle of the subjects."""
        return np.asarray(np.median([self.parameters(s, self.fit(s, names), name) for s in self.sums], axis=0))

    def impossible(self, names: Set) -> str:
        """Why a set cannot be: a parameter that is not physically possible in the middle of the subjects."""
        return next((said for name in names if (said := self.refusal(names, name))), "")

    def refusal(self, names: Set, name: str) -> str:
        """Why one effect of a set cannot be."""
        if name in SHAPES:
            return ""
        pairs = zip(self.effects[name].parameters, self.middle(names, name), strict=False)
        return next((f"{name}: {said}" for parameter, value in pairs if (said := parameter.refusal(float(value)))), "")

    def placed(self, names: Set) -> bool:
        """Whether one of them has a place of its own, which takes the constants."""
        return any(n in PLACED or any(p.name == "x" for p in self.effects[n].parameters) for n in names)

    def constants(self, names: Set) -> Array:
        """Mean square of each equation's constant in a model, (E,)."""
        fits = [(s, self.fit(s, names)) for s in self.sums]
        square = {e: float(np.mean([f.of(s, f"={e}")[0][0] ** 2 for s, f in fits])) for e in ("kinematic", "moment")}
        return np.array([square.get(e, 0.0) for e in self.equations])

    # -- scales -----------------------------------------------------------------------------------------------------------

    @property
    def equations(self) -> tuple[str, ...]:
        """Names of the equations."""
        return self.sums[0].equations

    @property
    def as_zmp(self) -> Array:
        """What an error of each equation is worth as ZMP, (E,): [s2] for accelerations, [1] for lengths; the vertical counts nothing."""
        worth = {"kinematic": 1.0 / self.sums[0].w2, "vertical": 0.0}
        return np.array([worth.get(e, 1.0) for e in self.equations])

    @property
    def floor(self) -> Array:
        """Rms that sensor noise gives in each equation, (E,); NaN where it is not known."""
        total = sum((s.floor * s.count).sum(1) for s in self.sums)
        return np.asarray(np.sqrt(total / sum(s.count.sum(1) for s in self.sums)))

    @property
    def usual(self) -> Array:
        """Rms that noise and the usual faults leave, (E,); NaN where the noise is not known."""
        return np.asarray(np.hypot(self.floor, self.faults))


def case_of(all_sums: Sequence[Sums], every: Mapping[str, Effect], offered: Sequence[str], faults: Array) -> tuple[Case, dict[str, str]]:
    """What competes: effects and shapes with a signature beyond the base; and what takes the others."""
    settled = tuple(k for k in offered if every[k].settled)
    weight = np.mean([1.0 / tolerance(s) for s in all_sums], axis=0) * decisive(all_sums[0])
    alone = {k: beyond(all_sums, weight, k) for k in offered}
    absorbed = {k: "a fitted w2 takes all of it" for k, left in alone.items() if left < 1 - ABSORBED}
    rivals = tuple(k for k in alone if k not in absorbed and k not in settled)
    alike = twins(all_sums, weight, (*settled, *rivals))
    for a, b in APART:
        if a in alike and b in alike:
            alike[a].add(b)
            alike[b].add(a)
    return Case(all_sums, every, settled, rivals, weight, alike, faults), absorbed


def decisive(s: Sums) -> Array:
    """1 for the equations that decide, 0 for the others."""
    return np.array([1.0 if len(s.equations) == 1 or e != "whole" else 0.0 for e in s.equations])


def tolerance(s: Sums) -> Array:
    """Variance that is not worth a word in each equation, (E,): sensor noise, and MODEL of what the paper's equation leaves.

    The moment side is not trusted beyond what the kinematic side is worth as ZMP: a parameter that stands in both is the latter's to tell.
    """
    base = residual_variance(s, decisive(s) / np.maximum(s.square.sum(1) / s.count.sum(1), 1e-30), s.of(()))
    noise = np.nan_to_num(np.sum(s.floor * s.count, axis=1) / s.count.sum(1))
    out = np.maximum(noise, MODEL**2 * base + 1e-30)
    if "kinematic" in s.equations:
        k, m = s.equations.index("kinematic"), s.equations.index("moment")
        out[m] = max(out[m], out[k] / s.w2**2)
    return np.asarray(out)


def constant(s: Sums, f: Fit) -> float:
    """Constant of the kinematic side [N]."""
    return float(f.of(s, "=kinematic")[0][0]) * s.mass


# -- what looks alike -------------------------------------------------------------------------------------------------


def own(s: Sums, *names: str) -> Index:
    """Columns of some effects."""
    return np.flatnonzero([n in names for n, _ in s.columns])


def projected(s: Sums, weight: Array, base: Index, mine: Index) -> Array:
    """Gram of some columns after the base is taken out, (k, k)."""
    g = np.einsum("e,ecij->ij", weight, s.gram)
    inner = g[np.ix_(base, mine)]
    gain = np.stack([solve(g[np.ix_(base, base)], inner[:, k]) for k in range(len(mine))], axis=1)
    return np.asarray(g[np.ix_(mine, mine)] - inner.T @ gain)


def beyond(all_sums: Sequence[Sums], weight: Array, name: str, base: Set = ()) -> float:
    """Largest share of an effect's columns that the base (with some effects) does not take; 1 over it is the variance inflation.

    Of what varies: a column's mean, which depends on where the laboratory's origin lies, is no part of it.
    """
    shares = []
    for s in all_sums:
        mine = own(s, name)
        whole = np.diag(projected(s, weight, own(s, *CONSTANT), mine))
        left = np.diag(projected(s, weight, s.of(base), mine))
        shares.append(max((a / b for a, b in zip(left, whole, strict=True) if b > 0), default=0.0))
    return float(np.mean(shares))


def twins(all_sums: Sequence[Sums], weight: Array, names: Set) -> dict[str, set[str]]:
    """Effects of one column whose signatures beyond the base are the same in these data."""
    single = [k for k in names if sum(n == k for n, _ in all_sums[0].columns) == 1]
    out: dict[str, set[str]] = {k: set() for k in names}
    total = np.zeros((len(single), len(single)))
    for s in all_sums:
        g = projected(s, weight, s.of(()), np.array([own(s, k)[0] for k in single], int)) if single else total
        d = np.sqrt(np.maximum(np.diag(g), 1e-30))
        total = total + np.abs(g / np.outer(d, d)) / len(all_sums)
    for i, a in enumerate(single):
        out[a] |= {b for j, b in enumerate(single) if i != j and total[i, j] > TWINS}
    return out


# -- the search -------------------------------------------------------------------------------------------------------


def search(case: Case) -> tuple[Set, list[Refused]]:
    """The set with the least score whose members are all needed, FALL counted for each, and the sets that would be better but cannot be."""
    sets = [k for k in subsets(case.rivals, min(MOST, len(case.rivals)), case.twins) if all(BESIDE[n] in k for n in k if n in BESIDE)]
    variance = case.variance(case.errors(sets))
    score = case.score(variance) + FALL * np.array([len(names) for names in sets])
    refused: list[Refused] = []
    for k in np.argsort(score, kind="stable"):
        reason = case.impossible(sets[k])
        if not reason and all(need(case, sets[k], n).enough for n in sets[k]):
            return sets[k], refused
        if reason and len(refused) < REFUSED:
            refused.append(Refused(sets[k], float(np.sqrt(variance[k, -1])), reason))
    return (), refused


# -- what is needed ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Need:
    """What an effect brings: fall of the score, p of no such effect, largest fall of an equation's rms as ZMP in units of the whole floor.

    trials: independent trials that find it with 80 % power at 5 %.  lowers: whether the error that is reported falls.
    """

    fall: float
    p: float
    share: float
    trials: float
    lowers: bool

    @property
    def enough(self) -> bool:
        """Whether it is needed: beyond chance and in practice."""
        return self.fall > FALL and self.p < SURE and self.share > SHARE


def need(case: Case, names: Set, name: str) -> Need:
    """Compare a model with the same without one of its effects."""
    pairs = case.with_and_without(names, name)
    with_it, lacks = [e[0] for e in pairs], [e[1] for e in pairs]
    v1, v0 = (case.variance([e[None] for e in errors])[0] for errors in (with_it, lacks))
    fall = float(case.score(v0[None])[0] - case.score(v1[None])[0])
    d = units([gains(case, s, a, b) for s, a, b in zip(case.sums, lacks, with_it, strict=True)])
    # a contact takes the constants with it: without it they would have to be something else
    bare = v0 + (case.constants(tuple(n for n in names if n != name)) if case.placed((name,)) else 0.0)
    fell = (np.sqrt(bare) - np.sqrt(v1)) * case.as_zmp
    noise = case.usual[-1]
    known = noise if np.isfinite(noise) else float(np.sqrt(v1[-1]))
    return Need(fall, chance(case, names, name), float(np.max(fell[case.weight > 0]) / known), trials_for(case, d), bool(v1[-1] < v0[-1]))


def chance(case: Case, names: Set, name: str) -> float:
    """p of no such effect in a model: of each subject, put together as Fisher did."""
    each = [case.fit(s, names).chance(s, name) for s in case.sums]
    return float(chdtrc(2 * len(each), -2 * np.sum(np.log(np.maximum(each, 1e-300)))))


def gains(case: Case, s: Sums, lacks: Array, with_it: Array) -> Array:
    """Score that each independent piece gains, as logs: no single piece outvotes the others."""
    where = np.unique(s.clusters[s.test], return_inverse=True)[1]
    out = np.zeros(where.max() + 1)
    for e in np.flatnonzero(case.weight > 0):
        count = np.bincount(where, s.count[e, s.test])
        a, b = (np.maximum(np.bincount(where, v[e, s.test]) / count, 0.0) + SPARED / case.weight[e] for v in (lacks, with_it))
        out += np.log(a / b)
    return out


def trials_for(case: Case, d: Array) -> float:
    """Trials like these that show a gain of this mean and spread with 80 % power at 5 %; infinite where it is none.

    d: gain of each unit, see `units`.
    """
    if len(d) < 2 or not d.mean() > 0:
        return float("inf")
    needed = ((1.645 + 0.842) * d.std(ddof=1) / d.mean()) ** 2 + 1  # standard errors: one-sided 5 %, 80 % power
    return float(max(needed * sum(len(s.trials) for s in case.sums) / len(d), 2.0))


def units(each: Sequence[Array]) -> Array:
    """What is independent of each other, of all subjects: subjects where there are enough, else what is independent in each."""
    return np.array([d.mean() for d in each]) if len(each) >= CLUSTERS else np.concatenate(each)


def pruned(case: Case, names: Set) -> Set:
    """Members that are needed beside each other, the least needed taken out first."""
    while names:
        needs = {n: need(case, names, n) for n in names}
        worst = min(names, key=lambda n: needs[n].fall)
        idle = [n for n in names if not needs[n].enough or case.refusal(names, n)]
        if not idle:
            return names
        names = tuple(n for n in names if n != (worst if worst in idle else idle[0]))
    return names
