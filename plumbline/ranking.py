"""What the data say is missing: the set that predicts trials left out, its constants, its families, and what became of every candidate."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from plumbline import outer
from plumbline.candidates import CONSTANTS, candidates
from plumbline.constants import constants
from plumbline.contest import FALL, Case, Need, Refused, case_of, constant, need, pruned, search
from plumbline.effects import Effect
from plumbline.evidence import Weak
from plumbline.false_discovery import false_discovery_rate
from plumbline.found import Candidate, Finding, Found, Interval
from plumbline.outer import CONTACT
from plumbline.search import Fit, Sums, on_disk, sums
from plumbline.shapes import BESIDE, SHAPES

Array = NDArray[np.float64]
Set = tuple[str, ...]

FAULT = 0.005  # [1] of the motion that a segment table and rigid segments leave in any study
LEFT = 1.35  # [1] residual over noise floor and that, above which something is left
WHOLE = 1.5  # [1] the same of the whole equation, where both halves are well explained and not together
MANY = 2  # causes of one study, above which they are doubted
PLAIN = 2.0  # [1] fall of the score that an effect must bring to be named where something is left that nobody explains
DROWNED = 4.0  # [1] residual over noise floor and usual faults, above which any name may be its shadow
WORSE = 1.05  # [1] of the error of the paper's equation, above which nothing is named: a fault of a scale may leave it as it is
SHADOW = 0.2  # [1] fall of the score by a shape, beside which a fault that is always fitted vanishes: it was the shape's shadow
LEANS = 1.1  # [1] h times w2 of a person who stands with an upright trunk, to begin with
LOWER = 0.9  # [1] of the error without it, which a constant must reach
SHOWS = 0.6  # [1] of what noise and usual faults leave, by which an effect of any motion must lower the rms to be named
SAME = 0.1  # [1] share of its fall that a member may lose when another effect takes its place, and the data cannot tell them apart
CHANCE = 0.05  # [1] false discovery rate over the catalogue, below which an effect is named
CONSTANT = ("=moment", "=kinematic")
ALWAYS = ("ang_mom", "height")  # physics has them in any motion; what they explain is not left, named or not


def judge(windows: Sequence[Sequence[Weak]], effects: Mapping[str, Effect], w2: Sequence[float], h: Sequence[float] = ()) -> Finding:
    """Judge the plant of some subjects on one axis.

    windows: of each subject.  effects: the catalogue.  w2: of each subject, (z'' + g)/z [1/s2].
    h: lever per acceleration of each subject as far as it is known [s2].
    """
    return _beyond_chance(_beside_contacts(windows, effects, w2, h))


def _beyond_chance(finding: Finding) -> Finding:
    """A finding with the false discovery rate over all that was tested; what may be chance by it is not named."""
    p = {c.effect: c.p for c in finding.candidates} | {(f.effect or ", ".join(f.family)): f.p for f in finding.found}
    q = false_discovery_rate({k: v for k, v in p.items() if np.isfinite(v)})
    tried = [replace(c, q=q.get(c.effect, float("nan"))) for c in finding.candidates]
    found = [replace(f, q=q.get(f.effect or ", ".join(f.family), float("nan"))) for f in finding.found]
    chance = {f.effect for f in found if f.q > CHANCE}
    dropped = [f for f in found if f.effect in chance]
    final = float(np.sqrt(finding.final**2 + sum(max(f.before**2 - f.after**2, 0.0) for f in dropped)))
    tried = [
        replace(c, status="idle", reason=f"may be chance: q = {c.q:.2g} over the catalogue") if c.effect in chance else c for c in tried
    ]
    return replace(finding, found=[f for f in found if f.effect not in chance], candidates=tried, final=final)


def _beside_contacts(windows: Sequence[Sequence[Weak]], effects: Mapping[str, Effect], w2: Sequence[float], h: Sequence[float]) -> Finding:
    """A contact that no plate measures is found first, and the rest judged beside it."""
    contacts = [outer.find(ws, float(FAULT * motion([ws], ("kinematic",))[0])) if CONTACT in effects else None for ws in windows]
    if not any(contacts):
        return _judge(windows, effects, w2, h)

    def still(k: int) -> list[Weak]:
        contact = contacts[k]
        return outer.quiet(windows[k], contact) if contact else list(windows[k])

    able = [k for k in range(len(windows)) if len(still(k)) > 1]
    if not able:  # nothing to compare with
        return replace(_judge(windows, effects, w2, h), left=("kinematic",))
    h = h or [LEANS / w for w in w2]
    mine = [w2[k] for k in able], [h[k] for k in able]
    finding = _judge(_Made(lambda i: still(able[i]), len(able)), effects, *mine)
    told = outer.named(finding, _Made(lambda i: windows[able[i]], len(able)), [contacts[k] for k in able], *mine)
    return told or _judge(windows, effects, w2, h)


@dataclass(frozen=True)
class _Made(Sequence[Sequence[Weak]]):
    """Windows of each subject, made when they are asked for."""

    make: Callable[[int], Sequence[Weak]]
    size: int

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, k: Any) -> Any:
        if k >= self.size:
            raise IndexError(k)
        return self.make(k)


def _judge(windows: Sequence[Sequence[Weak]], effects: Mapping[str, Effect], w2: Sequence[float], h: Sequence[float]) -> Finding:
    every = {**effects, **SHAPES}
    lacking: dict[str, str] = {}
    feet, places = [], []
    for ws in windows:
        every = {k: e for k, e in every.items() if all(k in w.terms for w in ws)}
        lacking |= {k: v for w in ws for k, v in w.lacking.items() if k in effects}
        feet.append([w.feet for w in ws])
        places.append(abs(float(np.mean([w.zmp.mean() for w in ws]))))
    offered = [k for k in every if k not in CONSTANTS and k != CONTACT]
    with TemporaryDirectory() as folder:
        made = (sums(ws, offered, w, k) for ws, w, k in zip(windows, w2, h or [LEANS / w for w in w2], strict=True))
        # of several subjects they lie on disk: memory does not grow with the cohort
        all_sums = [on_disk(s, Path(folder) / str(k)) if len(windows) > 1 else s for k, s in enumerate(made)]
        faults = FAULT * motion(windows, all_sums[0].equations)
        case, absorbed = case_of(all_sums, {**effects, **SHAPES}, offered, faults)
        best, refused = search(case)
        members = pruned(case, _plain(case, best))
        return _finding(case, members, refused, absorbed, lacking, (feet, max(places)))


def _plain(case: Case, members: Set) -> Set:
    """Members without shapes where nothing is left without them, or with an effect that looks the same; and without what any motion has
    where it hardly shows.
    """
    few = tuple(n for n in members if n not in SHAPES or n in BESIDE)
    causes = ((*few, k) for n in members if n in SHAPES for k in sorted(case.twins[n] - {*SHAPES, *case.settled, *few}))
    likely = (s for s in causes if not case.impossible(s) and need(case, s, s[-1]).enough)
    members = next((s for s in (few, *likely) if s != members and not _left(case, s)), members)
    faint = {n for n in members if n in ALWAYS and need(case, members, n).share < SHOWS}
    return tuple(n for n in members if n not in faint)


def _behind(case: Case, members: Set, name: str) -> str:
    """The shape beside which an effect that is always fitted vanishes, and which predicts far better: the effect was its shadow."""
    for shape in case.rivals:
        if shape in SHAPES and shape not in BESIDE and shape not in members and shape not in case.twins[name]:
            with_it = (*members, shape)
            size = abs(float(case.middle(with_it, name)[0]))
            if size < case.effects[name].parameters[0].matters and need(case, with_it, shape).fall > SHADOW:
                return shape
    return ""


def _lowered(case: Case, names: Set, columns: set[str]) -> bool:
    """Whether the error on trials left out is lower with some constants than with none."""
    every = {"=moment", "=kinematic"}
    return case.left_out(names, tuple(sorted(every - columns))) < LOWER * case.left_out(names, tuple(sorted(every)))


def _over(case: Case, members: Set) -> dict[str, float]:
    """Residual over noise and usual faults in each equation.

    At the fit over all trials: one that goes much further than the others cannot be told from them, and is no fault of the model.
    """
    offered = {n for n, _ in case.sums[0].columns}
    exact = tuple(n for n in ALWAYS if n in offered and n not in members and not case.twins.get(n, set()) & set(members))
    variance = np.min([case.inside((*members, *more)) for more in ((), exact)], axis=0)
    return dict(zip(case.equations, (np.sqrt(variance) / case.usual).tolist(), strict=True))


def _left(case: Case, members: Set, limit: float = WHOLE) -> tuple[str, ...]:
    """Equations in which more is left than noise and a model's usual faults explain.  limit: of the whole one."""
    over = _over(case, members)
    if over["whole"] > limit:  # parameters that suit each half alone and not both
        return tuple(dict.fromkeys((*_parts_left(case, over), "whole")))
    return _parts_left(case, over)


def _parts_left(case: Case, over: Mapping[str, float]) -> tuple[str, ...]:
    return tuple(e for e, w, z in zip(over, case.weight, case.as_zmp, strict=True) if w * z > 0 and over[e] > LEFT)


# -- what is said -----------------------------------------------------------------------------------------------------


def _finding(
    case: Case, members: Set, refused: Sequence[Refused], absorbed: Mapping[str, str], lacking: Mapping[str, str],
    stand: tuple[Sequence[Sequence[float]], float],
) -> Finding:  # fmt: skip
    needs = {n: need(case, members, n) for n in (*members, *case.settled) if n in members or not case.twins[n] & set(members)}
    told = _doubted(case, members, needs)
    refused = [*refused, *told.refused]
    whole = len(case.equations) - 1
    kept = constants(case, members, *stand) if CONSTANTS[0] not in lacking and not (told.left or told.shapes) else []
    if kept and not _lowered(case, told.model, {c for one in kept for c in one.columns}):
        kept = []
    silent = tuple({*CONSTANT} - {c for one in kept for c in one.columns})
    final = case.left_out(told.model, () if case.placed(told.model) else silent)
    found = [_found(case, members, n, needs[n], final) for n in told.named]
    for one in kept:
        found = _with_constant(found, one.effect, one.family, one.parameters, final, one.size, one.p)
    fits = [case.fit(s, members) for s in case.sums]
    theta = [{n: f.of(s, n)[0] for n in dict.fromkeys(s.columns[c][0] for c in f.columns)} for s, f in zip(case.sums, fits, strict=True)]
    tried = candidates(case, members, found, needs, refused, absorbed, lacking)
    tried = [_sized(case, members, c) if c.status == "settled" else c for c in tried]
    base = case.left_out((), CONSTANT)
    return Finding(found, told.shapes, refused, tried, lacking, base, final, float(case.floor[whole]), told.over, told.left, theta)


class _Told(NamedTuple):
    """What of a model may be said: effects to name, those refused, shapes that are needed, residual over noise and faults and where it is
    left, and the effects that the last error is with."""

    named: list[str]
    refused: list[Refused]
    shapes: Set
    over: dict[str, float]
    left: tuple[str, ...]
    model: Set


def _doubted(case: Case, members: Set, needs: Mapping[str, Need]) -> _Told:
    """Effects that matter, less those that may be the shadow of something that nobody explains."""
    named = [n for n in needs if n not in SHAPES and _matters(case, members, n, needs[n])]
    # many causes at once can put on the look of one that no list has: they must hold together all the better
    over, left = _over(case, members), _left(case, members, LEFT if len(named) > MANY else WHOLE)
    behind = {n: _behind(case, members, n) for n in named if n in case.settled}
    refused = [Refused((n,), float("nan"), f"vanishes beside {SHAPES[k].title}") for n, k in behind.items() if k]
    named = [n for n in named if not behind.get(n)]
    shapes = tuple(dict.fromkeys((*(n for n in members if n in SHAPES and n not in BESIDE), *filter(None, behind.values()))))
    if left or shapes:  # what nobody explains may look like any effect a little
        most = max(o * u for o, u, w in zip(over.values(), case.usual * case.as_zmp, case.weight, strict=True) if w > 0)
        drowned = max(over[e] for e, z in zip(over, case.weight * case.as_zmp, strict=True) if z > 0) > DROWNED
        doubtful = [n for n in named if drowned or needs[n].fall < PLAIN or needs[n].share * case.usual[-1] < most or not needs[n].lowers]
        refused += [Refused((n,), float("nan"), "small beside what nobody explains") for n in doubtful]
        named = [n for n in named if n not in doubtful]
    model = (*members, *(n for n in named if n not in members))
    base, final = case.left_out((), CONSTANT), case.left_out(model, () if case.placed(model) else CONSTANT)
    if not named or final <= WORSE * base:
        return _Told(named, refused, shapes, over, left, model)
    # it suits each half of the equation and not the whole: what the whole lacks is something else
    refused += [Refused((n,), final, "the error on trials left out grows with it") for n in named]
    if base > LEFT * case.usual[-1]:
        left = tuple(dict.fromkeys((*left, "whole")))
        over = over | {"whole": float(base / case.usual[-1])}
    return _Told([], refused, shapes, over, left, ())


def _sized(case: Case, members: Set, settled: Candidate) -> Candidate:
    """An effect that is always fitted, with its size; refused where it cannot be."""
    said = case.refusal(members, settled.effect)
    if said:
        return replace(settled, status="refused", reason=said)
    return replace(settled, parameters=_parameters(case, members, settled.effect))


def motion(windows: Sequence[Sequence[Weak]], equations: Sequence[str]) -> Array:
    """Rms of what markers measure in each equation, (E,): acceleration of the CoM [m/s2]; its place from the mean and its lever [m]."""
    square, lever, place, count = 0.0, 0.0, 0.0, 0
    for ws in windows:
        x = np.concatenate([w.com for w in ws])
        square += float(sum(w.acceleration @ w.acceleration for w in ws))
        lever += float(sum(np.sum((w.lever - np.mean(w.lever)) ** 2) for w in ws))
        place += float(np.sum((x - np.mean(x)) ** 2))
        count += len(x)
    size = {"kinematic": float(np.sqrt(square / count)), "vertical": 0.0}
    return np.array([size.get(e, float(np.sqrt((place + lever) / count))) for e in equations])


def _matters(case: Case, members: Set, name: str, needed: Need) -> bool:
    """Whether it deserves a name: large enough, beyond its own interval, and needed."""
    value, half = abs(float(case.middle(members, name)[0])), float(_reach(case, members, name)[0])
    return bool(value >= case.effects[name].parameters[0].matters and value > half) and needed.enough


def _found(case: Case, members: Set, name: str, needed: Need, final: float) -> Found:
    v1, v0 = (np.sqrt(v[-1]) for v in case.variance(case.with_and_without(members, name)))
    before = float(np.sqrt(max(final**2 + v0**2 - v1**2, 0.0)))
    return Found(
        name, tuple([name, *_alike(case, members, name, needed)]), _parameters(case, members, name), before, final, needed.p, needed.p
    )


def _parameters(case: Case, members: Set, name: str) -> dict[str, Interval]:
    """Value and 95 % interval of each parameter."""
    names = [p.name for p in case.effects[name].parameters]
    values, half = case.middle(members, name), _reach(case, members, name)
    return {k: (float(v), float(v - h), float(v + h)) for k, v, h in zip(names, values, half, strict=False)}


def _reach(case: Case, members: Set, name: str) -> Array:
    """Half of the 95 % interval of each parameter: of the middle of the subjects, or, of one, from its own covariance."""
    fits = [case.fit(s, members) for s in case.sums]
    if len(fits) > 2:
        each = np.array([case.parameters(s, f, name) for s, f in zip(case.sums, fits, strict=True)])
        return np.asarray(1.25 * stdtrit(len(fits) - 1, 0.975) * each.std(axis=0, ddof=1) / np.sqrt(len(fits)))  # 1.25: a median's
    half = np.array([_own_reach(case, s, f, name) for s, f in zip(case.sums, fits, strict=True)])
    return np.asarray(np.sqrt(np.mean(half**2, axis=0) / len(fits)))


def _own_reach(case: Case, s: Sums, f: Fit, name: str) -> Array:
    """Half of the 95 % interval of one subject, the covariance carried through to the parameters."""
    theta, covariance = f.of(s, name)
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    at = case.parameters(s, f, name)
    slopes = []
    for k in range(len(theta)):
        step = np.where(np.arange(len(theta)) == k, sd[k], 0.0)
        slopes.append((case.effects[name].of_coefficients(theta + step, constant(s, f)) - at) / sd[k])
    jacobian = np.stack(slopes, axis=1)
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    return np.asarray(float(stdtrit(max(f.clusters - 1, 1), 0.975)) * np.sqrt(np.maximum(variance, 0.0)))


def _alike(case: Case, members: Set, name: str, needed: Need) -> Iterator[str]:
    """Effects that could take the place of a member and predict as well, and those that no motion tells from it."""
    rest = tuple(n for n in members if n != name)
    yield from (k for k, e in case.effects.items() if e.twin == name)
    others = [k for k in (*case.rivals, *case.settled) if k not in members and k != name and k not in SHAPES]
    score = float(case.score(case.variance(case.errors([members])))[0])
    for k in others:
        other = case.score(case.variance(case.errors([(*rest, k)], without=name)))[0]
        if other - score < max(SAME * needed.fall, FALL / 2) and not case.impossible((*rest, k)):
            yield k


def _with_constant(
    found: Sequence[Found], effect: str, family: Set, parameters: Mapping[str, Interval], final: float, size: float, p: float
) -> list[Found]:  # fmt: skip
    """The effects found, with one that was told by its constant; it joins an entry of its own id."""
    for k, one in enumerate(found):
        if one.effect in family:
            both = replace(one, parameters={**one.parameters, **(parameters if effect == one.effect else {})})
            return [*found[:k], replace(both, before=float(np.hypot(one.before, size))), *found[k + 1 :]]
    return [*found, Found(effect, family, parameters, float(np.hypot(final, size)), final, p, p)]
