"""The control ledger: what the law lacks, by output error on trials left out; table `control`.

Every control effect of the catalogue, alone and in pairs with those that help, competes with the base law for the ZMP and the CoM from
push end on. A law is fitted to all loci, then judged on each trial with the parameters of the other trials. Instrument effects found in
the plant ledger are taken out before: a force record 16 ms late looks like a reaction.
"""

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.control_rows import blank, of_fit
from plumbline.control_scene import FEWEST_LOCI, Known, Sizes, Stage, staged
from plumbline.control_shapes import offered
from plumbline.control_verdict import COUNTS, judge
from plumbline.criticism import Outside, twins
from plumbline.effects import HERE as LIBRARY
from plumbline.effects import Effect, catalogue, where
from plumbline.estimators import loop_error
from plumbline.estimators.loop_error import Candidate, Criterion, Fit
from plumbline.groups import by_group
from plumbline.models.loop import Scene, Term, simulate
from plumbline.tables import TABLES

Array = NDArray[np.float64]

TASK = "lateral"
FOLDS = 8
AWAY, NEVER_AWAY = 8.0, 0.02  # times the median rms of the loci, and [m], from which the simulated CoM has left a locus
HELPS = 4.0  # log likelihood on trials left out from which on an effect is tried in pairs
PARTNERS = 2  # effects that are tried in pairs with all others
ACCEPTED = 10.0  # log likelihood on trials left out from which on a framewise effect stands in every simulated law
EARLY = 0.8  # [s] from a locus' start that counts then: later noise and zone decide together where the person drifts
AGAIN = 8  # rounds of a fit begun from one of a part of it, or of the same under another criterion
ROUGH = 6  # rounds of framewise fits: their sizes have next to no slope
NEAR = (0.7, 1.4)  # of a framewise effect's size, within which it may move in the simulated law
AROUND = (0.75, 0.85, 0.92, 1.0, 1.08, 1.17, 1.3)  # of a size that has no slope, to begin the last search from


def of_part(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    coverage: pd.DataFrame,
    trust: pd.DataFrame,
    clusters: pd.DataFrame,
    controller: pd.DataFrame,
    evaluation: Mapping[str, Any],
    corrected: Mapping[str, Sizes] | None = None,
    plant: Mapping[str, Sizes] | None = None,
    contacts: Mapping[str, Outside] | None = None,
    effects: Mapping[str, Effect] | None = None,
    model: Sequence[str] = (),
) -> pd.DataFrame:
    """Table `control` of whole subjects: one row per candidate and trial left out; or one row that says why there is none.

    corrected: subject -> {"sync": [0.016], ...}, instrument effects to take out of the CoM and the ZMP first.  plant: the same for what
    moves the body beside the ZMP ("ang_mom", "hand", ...): the CoM and its velocity at push end are then known better.
    contacts: subject -> contact beside the plates, which moves the body too.
    effects: the catalogue, default the library's.  model: effects of the configured model; those of the control ledger are fitted
    together in any case.
    """
    del evaluation  # every stage takes it; laws are not judged by test functions
    every = effects if effects is not None else catalogue()
    known = {k: e for k, e in every.items() if e.ledger == "control" and e.law}
    rows: list[dict[str, Any]] = []
    lateral = loci[loci["task"] == TASK]
    for key, mine in by_group(lateral):
        about = key._asdict()
        faults, others = (dict((c or {}).get(key.subject, {})) for c in (corrected, plant))
        settled = Known(faults, others, every, (contacts or {}).get(key.subject))
        best: list[dict[str, Any]] = []
        for reading in _readings(settled):
            if best and _accused(best, every) <= (0.0, COUNTS):
                break  # the record read as it was found asks nothing of the law
            found = staged(about, mine, signals, pushes, coverage, trust, clusters, controller, reading)
            if isinstance(found, str):
                told = [blank() | about | {"reason": found}]
            else:
                known = {k: e for k, e in known.items() if _works(e, found)}
                told = [row | about for row in _ledger(found, known, tuple(sorted(set(model) & set(known))))]
            best = min(best, told, key=lambda one: _accused(one, every)) if best else told
        rows += best
    return pd.DataFrame(rows, columns=[c.name for c in TABLES["control"]])


def _readings(settled: Known) -> Iterator[Known]:
    """What the plant ledger has found, and the same with a fault of a record read as one that no motion tells from it."""
    yield settled
    for name, sizes in settled.faults.items():
        for twin in twins(name, settled.effects):
            if not twin.parameters[0].refusal(sizes[0]):
                others = {k: v for k, v in settled.faults.items() if k != name}
                yield settled._replace(faults={**others, twin.id: sizes})


def _accused(rows: Sequence[Mapping[str, Any]], effects: Mapping[str, Effect]) -> tuple[float, float]:
    """Faults of the law that rows of `control` name, then log likelihood that it gains by any: of two readings the lesser is taken.

    Where both name one it does not matter by how much.
    """
    block = judge(pd.DataFrame(rows, columns=[c.name for c in TABLES["control"]]), effects=effects)
    if block["missing"] is None:
        return np.inf, np.inf
    if number := len(block["missing"]) + block["unexplained"]:
        return number, 0.0
    score: Counter[str] = Counter()
    for row in rows:
        if row["mode"] == "loop":
            score[row["candidate"]] += row["score"]
    return 0.0, (score[""] - min(score.values())) / 2


def _works(effect: Effect, stage: Stage) -> bool:
    """Whether a study's own effect can be simulated; where not, the log says why and the others go on."""
    if Path(effect.file).parent == LIBRARY:
        return True
    for term in effect.law:
        try:
            sizes = np.concatenate([stage.base, term.starts[0]])
            simulate(sizes[:, None, None], stage.scene, [(term, len(effect.parameters))])
        except Exception as error:  # a user's file may fail in any way
            print(f"{effect.file} cannot be used and the others go on: {where(error, Path(effect.file))}")
            return False
    return True


# -- the ledger -------------------------------------------------------------------------------------------------------


Settled = Mapping[str, tuple[Term, tuple[float, ...]]]


def candidates(
    known: Mapping[str, Effect], names: tuple[str, ...], settled: Settled | None = None, *, closed: bool = True
) -> list[Candidate]:
    """A set of effects as candidates, one per combination of their variants; none where an effect would leave no trace in the set.

    settled: effect -> its variant and the sizes to begin from, where both are known.  In the loop a framewise effect stays NEAR its
    size; frame by frame the others keep theirs.
    """
    effects, settled = [known[n] for n in names], settled or {}
    variants = [(settled[n][0],) if n in settled else known[n].law for n in names]
    out = []
    for terms in itertools.product(*variants):
        if any(t.beside and not set(t.beside) & set(names) for t in terms):
            continue
        starts = [(settled[n][1],) if n in settled else t.starts for n, t in zip(names, terms, strict=True)]
        low, high = [], []
        for n, t, start, e in zip(names, terms, starts, effects, strict=True):
            few = NEAR if closed and t.framewise else (1.0, 1.0) if not closed and n in settled and not t.framewise else None
            low += [few[0] * s for s in start[0]] if few else [p.lower for p in e.parameters]
            high += [few[1] * s for s in start[0]] if few else [p.upper for p in e.parameters]
        counted = tuple((t, len(e.parameters)) for t, e in zip(terms, effects, strict=True))
        begin = np.array([sum(c, ()) for c in itertools.product(*starts)], float)
        out.append(Candidate(names, counted, tuple(low), tuple(high), begin, closed))
    return out


def _settled(got: Fit) -> dict[str, tuple[Term, tuple[float, ...]]]:
    """Variant and sizes of each effect of a fit."""
    ends = np.cumsum([3, *[count for _, count in got.candidate.terms]])
    pieces = [tuple(got.theta[a:b]) for a, b in itertools.pairwise(ends)]
    return {n: (t, sizes) for n, (t, _), sizes in zip(got.candidate.effects, got.candidate.terms, pieces, strict=True)}


PLAIN = Candidate((), (), (), (), np.zeros((1, 0)))


@dataclass
class _Search:
    """Fits of one group under one criterion; given: framewise effects that stand in every law."""

    stage: Stage
    known: Mapping[str, Effect]
    whiten: loop_error.Whiten
    base: Array
    given: Settled
    closed: bool = True
    done: dict[int, tuple[Fit, tuple[Array, ...]]] = field(default_factory=dict)

    def best(self, names: tuple[str, ...], settled: Settled | None = None) -> Fit | None:
        """The best variant of a set of effects beside those given."""
        names = tuple(sorted({*names, *self.given}))
        tried = candidates(self.known, names, {**(settled or {}), **self.given}, closed=self.closed)
        bases = np.array([self.base, self.stage.late] if names and not settled else [self.base])
        rounds = ROUGH if not self.closed else AGAIN if settled else loop_error.ROUNDS
        fits = [loop_error.fit(c, bases, self.stage.scene, self.whiten, rounds) for c in tried]
        return min(fits, key=_cost) if fits else None

    def beside(self, names: tuple[str, ...], fits: Sequence[Fit]) -> Fit | None:
        """The best fit of a set, begun from the best of its subsets: their variants and sizes, with the starts of the others."""
        part = min((f for f in fits if set(f.candidate.effects) < set(names)), key=_cost)
        self.base = part.theta[:3]
        return self.best(names, _settled(part))

    def again(self, old: Fit) -> Fit:
        """A fit begun from where it ended under another criterion."""
        near = replace(old.candidate, starts=old.theta[None, 3:])
        return loop_error.fit(near, old.theta[:3], self.stage.scene, self.whiten, AGAIN)

    def sums(self, got: Fit) -> tuple[Array, ...]:
        """Of each locus with the parameters of the other trials: the first four sums of squares of the table."""
        if id(got) not in self.done:
            scene = self.stage.scene
            left_out = loop_error.left_out(got, _folds(self.stage.trials), scene, self.whiten)
            theta = np.stack([left_out, np.repeat(got.theta[:, None], left_out.shape[1], axis=1)], axis=1)
            dx, dp, e = loop_error.judged(theta, got.candidate, scene, self.whiten)
            self.done[id(got)] = got, (dx[0], dp[0], e[0], dx[1])
        return self.done[id(got)][1]

    def score(self, got: Fit) -> Array:
        """The criterion of each locus with the parameters of the other trials."""
        return self.sums(got)[2]

    def rows(self, got: Fit) -> Iterator[dict[str, Any]]:
        """Rows of `control` of a candidate."""
        yield from of_fit(got, self.sums(got), self.stage, self.known)


def _cost(got: Fit) -> float:
    return float(got.cost.sum())


def _ledger(stage: Stage, known: Mapping[str, Effect], model: tuple[str, ...]) -> Iterator[dict[str, Any]]:
    """Rows of `control` of one group."""
    scene = stage.scene
    first = simulate(stage.base[:, None, None], scene)
    law = loop_error.fit(PLAIN, stage.base, scene, loop_error.joint(first, scene))
    stays = _stays(simulate(law.theta[:, None, None], scene), scene)
    if not stays.all():
        stage = stage.take(stays)
        scene = stage.scene
        law = loop_error.fit(PLAIN, law.theta, scene, loop_error.joint(simulate(law.theta[:, None, None], scene), scene))
    by_frame = (loop_error.criterion(simulate(t[:, None, None], scene, closed=False), scene) for t in (law.theta, stage.base))
    frame = next((c for c in by_frame if c is not None), None)
    made = _criterion(law, scene) or frame  # where the simulated law runs away the frames still count
    if made is None or frame is None:
        yield blank() | {"reason": "too few frames inside the limits of the ZMP"}
        return
    shapes = offered(law.theta, scene, frame)
    known = {**known, **shapes}
    framewise = tuple(n for n, e in known.items() if any(t.framewise for t in e.law))
    search = _Search(stage, known, made, law.theta, {})
    fits, gains = _singles(search, tuple(n for n in known if n not in framewise))
    partners = [n for n in sorted(gains, key=lambda n: -gains[n]) if gains[n] > HELPS and n not in shapes][:PARTNERS]
    best = next((_settled(f) for f in fits for n in partners[:1] if f.candidate.effects == (n,)), {})
    alone, rows = _framewise(_Search(stage, known, frame, law.theta, {}, closed=False), framewise, best)
    yield from rows
    if alone is not None:
        search = _Search(stage, known, _criterion(alone, scene, EARLY) or made, alone.theta[:3], _settled(alone))
        fits = [fits[0], *[f for f in [search.best(())] if f is not None]]
    else:
        others = [*gains, *(n for n in known if n not in framewise and n not in gains)]  # the latter leave no trace alone
        pairs = [{n, b} for n in partners for b in others if b != n and (n == partners[0] or b not in shapes)]
        fits += _several(search, fits, pairs, model)
    for f in fits:
        yield from search.rows(f)


def _stays(outputs: Array, scene: Scene) -> NDArray[np.bool_]:
    """Loci (m,) that a law follows, outputs (2, n, 1, m): near a fall the smallest push of noise decides, and one such locus all."""
    rms = np.sqrt(np.sum(outputs[0][:, 0] ** 2, axis=0) / scene.batch.inside.sum(0))
    stays = rms < max(AWAY * float(np.median(rms)), NEVER_AWAY)
    return np.asarray(stays if stays.sum() >= FEWEST_LOCI else np.ones_like(stays))


def _singles(search: _Search, names: tuple[str, ...]) -> tuple[list[Fit], dict[str, float]]:
    """The base law and each effect alone, under the colour of the best of them; log likelihood gained on trials left out."""
    fits = [f for f in [search.best(()), *[search.best((n,)) for n in names]] if f is not None]
    search.whiten = _criterion(min(fits, key=_cost), search.stage.scene) or search.whiten
    fits = [search.again(f) for f in fits]
    base, trials = search.score(fits[0]), search.stage.trials
    return fits, {f.candidate.effects[0]: loop_error.gain(base, search.score(f), trials)[0] for f in fits[1:]}


def _several(search: _Search, fits: Sequence[Fit], pairs: Sequence[set[str]], model: tuple[str, ...]) -> list[Fit]:
    """Fits of pairs and of the configured model, where it is none of those there."""
    there = {f.candidate.effects for f in fits}
    wanted = {tuple(sorted(pair)) for pair in pairs} | {model}
    done = [search.beside(names, fits) for names in sorted(wanted - there)]
    return [f for f in done if f is not None]


def _framewise(search: _Search, names: tuple[str, ...], best: Settled) -> tuple[Fit | None, list[dict[str, Any]]]:
    """The effect that is there frame by frame, at most one, as a fit of it alone; the rows of all.

    best: the simulated effect that helps most: a framewise one must count alone and beside it.
    """
    rows: list[dict[str, Any]] = []
    gains: dict[str, float] = {}
    found: dict[str, Fit] = {}
    for beside in [{}, best] if best else [{}]:
        there = tuple(sorted(beside))
        tried = [n for n in names if gains.get(n, np.inf) > ACCEPTED]
        plain = search.best(there, beside) if tried else None
        if plain is None:
            continue
        base = search.score(plain)
        rows += search.rows(plain)
        for name in tried:
            got = search.best(tuple(sorted((*there, name))), beside)
            if got is None:
                continue
            got = _refined(search, got, name) if _cost(plain) - _cost(got) > ACCEPTED else got
            rows += search.rows(got)
            rivals = [got, *[found[n] for n in [name] if n in found]]  # beside the other effect, or alone better than that alone
            gain = max(loop_error.gain(base, search.score(f), search.stage.trials)[0] for f in rivals)
            gains[name] = min(gain, gains.get(name, np.inf))
            found.setdefault(name, got)
    most = max(gains, key=lambda n: gains[n], default="")
    return (found[most] if most and gains[most] > ACCEPTED else None), rows


def _refined(search: _Search, got: Fit, name: str) -> Fit:
    """A framewise fit begun again from sizes AROUND those found."""
    near = []
    for share in AROUND:
        sizes = {n: tuple(share * s for s in size) if n == name else size for n, (_, size) in _settled(got).items()}
        near.append(sum((sizes[n] for n in got.candidate.effects), ()))
    candidate = replace(got.candidate, starts=np.array(near))
    return loop_error.fit(candidate, got.theta[:3], search.stage.scene, search.whiten, ROUGH)


def _criterion(got: Fit, scene: Scene, until: float = np.inf) -> Criterion | None:
    return loop_error.criterion(got.candidate.simulate(got.theta[:, None, None], scene), scene, until)


def _folds(trials: Sequence[str]) -> NDArray[np.int64]:
    """Number of the fold in which each locus is left out: by trial, at most FOLDS."""
    return np.unique(trials, return_inverse=True)[1] % FOLDS
