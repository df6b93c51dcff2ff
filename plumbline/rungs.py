"""The ladder's rungs: error of each model on trials left out, its free run, what each effect contributes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import evidence, outer
from plumbline.contest import decisive, own, tolerance
from plumbline.criticism import TRIALS, gravity, in_use
from plumbline.effects import Catalogue, Channels
from plumbline.effects._channels import of_trial, persons
from plumbline.evidence import Weak
from plumbline.fit import folds, free_runs
from plumbline.outer import CONTACT
from plumbline.physics import G
from plumbline.plant import Plant, of_trials
from plumbline.ranking import FAULT, motion
from plumbline.search import Fit, Sums, design, fit, sums
from plumbline.study import names
from plumbline.tables import joined

Array = NDArray[np.float64]
Models = Sequence[tuple[str, tuple[str, ...]]]

NEAR = 3  # candidates that came nearest, whose contribution is drawn beside that of what was found


@dataclass(frozen=True)
class Trial:
    """What a trial is called."""

    trial: str
    names: frozenset[str]


def models(config: Models, tried: pd.DataFrame, axis: str) -> list[tuple[str, tuple[str, ...]]]:
    """Models of the ladder's rungs on one axis: those of the config; or what was found in all subjects, one after the other.

    tried: the table `candidates`.
    """
    if config:
        return list(config)
    found = tried[(tried["axis"] == axis) & (tried["subject"] == "all") & (tried["status"] == "found") & (tried["effect"] != "")]
    climbed = [str(e) for e in found["effect"]]
    return [("+ " + climbed[k], tuple(climbed[: k + 1])) for k in range(len(climbed))]


def of_part(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, table: pd.DataFrame, judged: pd.DataFrame, tried: pd.DataFrame,
    effects: Catalogue, config: Models, evaluation: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame]:  # fmt: skip
    """Tables `rungs` and `contributions` of whole subjects.

    table: `evidence` of the part.  judged, tried: tables `judged`, `candidates` of the cohort.  coverage: with the column `files`.
    """
    rungs: list[dict[str, Any]] = []
    shown: list[pd.DataFrame] = []
    for (subject, axis), rows in table.groupby(["subject", "axis"], sort=True, observed=True):
        mine = judged[(judged["subject"] == subject) & (judged["axis"] == axis)]
        windows = in_use(list(evidence.from_table(rows)))
        # where nothing could be looked for, the user's own models are judged all the same
        if mine.empty or len(windows) < TRIALS or (mine["reason"].iloc[0] and not config):
            continue
        w2, h = (float(mine[k].iloc[0]) for k in ("w2", "h"))
        level = (w2, h) if not mine["reason"].iloc[0] else (gravity(windows), 1.0 / gravity(windows))
        chosen = models(config, tried, str(axis))
        own_com = _Own(signals, pushes, coverage[coverage["subject"] == subject], str(axis), evaluation, effects)
        near = _near(tried[(tried["axis"] == axis) & (tried["subject"] == "all")])
        bench = _Bench(windows, effects, {*near, *(e for _, es in chosen for e in es)}, level, evaluation)
        plants = _plants(signals, pushes, coverage[coverage["subject"] == subject], str(axis), evaluation)
        called = {str(r["trial"]): names(r["trial"], r["task"], str(r["files"]).split(" + ")) for _, r in coverage.iterrows()}
        trials = [Trial(w.trial, frozenset(called[w.trial])) for w in bench.windows]
        for number, (name, listed) in enumerate(chosen, 1):
            members = [m for m in listed if effects[m].ledger == "plant" and (m != CONTACT or bench.contact is not None)]
            # no effects: the paper's own; only the law's, a contact that is not seen, or what these data cannot judge: no rung
            if (listed and not members) or not {*members} - {CONTACT} <= {*bench.offered}:
                continue
            about_model = {"rung": number, "model": name, "effects": ", ".join(listed)}
            exact = tuple(sorted(m for m in members if effects[m].exact))
            rest = [m for m in members if m not in exact]
            used = _Bench(own_com.windows(exact, windows), effects, {*rest}, level, evaluation, exact=True) if exact else bench
            rungs += [row | about_model for row in used.rung(rest, trials, {} if exact else plants)]
        shown.append(bench.contributions([(n, tuple(m for m in ms if effects[m].ledger == "plant")) for n, ms in chosen], near))
    return joined("rungs", [pd.DataFrame(rungs)] if rungs else []), joined("contributions", shown)


def _near(tried: pd.DataFrame) -> list[str]:
    """What was found, and the candidates that would lower the error most beside it."""
    found = [str(e) for e in tried.loc[tried["status"] == "found", "effect"] if e]
    others = (
        tried[tried["status"].isin(["idle", "refused", "settled"])].dropna(subset=["fall_high"]).sort_values("fall_high", ascending=False)
    )
    return [*found, *(str(e) for e in others["effect"].head(NEAR))]


class _Own:
    """Windows of one subject and axis with other channels: for effects whose whole size physics fixes (`Effect.exact`)."""

    def __init__(
        self, signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, axis: str, evaluation: Mapping[str, Any],
        effects: Catalogue,
    ) -> None:  # fmt: skip
        self.given, self.axis, self.evaluation, self.effects = (signals, pushes, coverage), axis, evaluation, effects
        self.made: dict[tuple[str, ...], list[Weak]] = {}

    def windows(self, names: tuple[str, ...], usual: Sequence[Weak]) -> list[Weak]:
        """Windows with some effects taken out, of the same trials as `usual`."""
        if names not in self.made:
            size = {n: np.array([float(p.physics or 0.0) for p in self.effects[n].parameters]) for n in names}
            made = evidence.of_part(*self.given, self.effects, self.evaluation, undo=size, axis=self.axis)
            wanted = {w.trial for w in usual}
            self.made[names] = [replace(w, centre={}) for w in made if w.trial in wanted]  # gone for good
        return self.made[names]


@dataclass(frozen=True)
class _Motion:
    """Channels and plant of one trial."""

    channels: Channels
    plant: Plant


def _plants(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, axis: str, evaluation: Mapping[str, Any]
) -> dict[str, _Motion]:  # fmt: skip
    settings: dict[str, Any] = {k: evaluation[k] for k in ("half_width", "exponent")}
    who = persons(signals, coverage)
    return {
        str(about["trial"]): _Motion(of_trial(frames, axis, float(about["mass"]), who[about["subject"]]), plants[axis])
        for about, frames, plants in of_trials(signals, pushes, coverage, **settings, axes=(axis,))
        if axis in plants
    }


class _Bench:
    """Windows of one subject and axis, on which models are tried.

    level: w2 [1/s2] and lever per acceleration [s2].  exact: what physics fixes is not fitted: the mechanics written out.
    """

    def __init__(
        self, windows: list[Weak], effects: Catalogue, wanted: set[str], level: tuple[float, float], evaluation: Mapping[str, Any],
        exact: bool = False,
    ) -> None:  # fmt: skip
        self.exact = exact
        self.windows, self.effects, self.evaluation = windows, effects, evaluation
        able = {k for k in windows[0].terms if all(k in w.terms for w in windows)}
        self.offered = sorted(wanted & able)
        self.w2, self.h = self.level = level
        self.sums = sums(windows, self.offered, self.w2, self.h)
        self.weight = decisive(self.sums) / tolerance(self.sums)
        self.fixed = evaluation["w2"] == "height"
        faults = float(FAULT * motion([windows], ("kinematic",))[0])
        self.contact = outer.find(windows, faults) if CONTACT in wanted else None

    def rung(self, members: Sequence[str], trials: Sequence[Trial], plants: Mapping[str, _Motion]) -> Iterator[dict[str, Any]]:
        """Rows of `rungs` of one model."""
        if self.contact is not None and CONTACT in members:
            yield from self._with_contact(self.contact, [m for m in members if m != CONTACT], trials)
            return
        number = {w.trial: k for k, w in enumerate(self.windows)}
        for _, train, test in folds(trials, self.evaluation):
            got = self.fit(members, np.isin(self.sums.trial, [number[t.trial] for t in train]))
            for t in test:
                yield self._row(number[t.trial], got, members, plants.get(t.trial))

    def _with_contact(self, contact: outer.Contact, members: Sequence[str], trials: Sequence[Trial]) -> Iterator[dict[str, Any]]:
        """The same with a contact beside the plates: the rest is fitted where it does not act; no free run, as nobody measured it."""
        still = _Bench(outer.quiet(self.windows, contact), self.effects, set(members), self.level, self.evaluation, self.exact)
        number = {w.trial: k for k, w in enumerate(still.windows)}
        rest = [self.error(w, self.fit(()), ()) for w in self.windows]
        times: list[Array | float] = [1.0] * len(rest)
        judged: set[str] = set()
        for _, train, test in folds(trials, self.evaluation):
            got = still.fit(members, np.isin(still.sums.trial, [number[t.trial] for t in train if t.trial in number]))
            for t in test:
                judged.add(t.trial)
                k = next(k for k, w in enumerate(self.windows) if w.trial == t.trial)
                rest[k] = still.error(self.windows[k], got, (*members, CONTACT))
                times[k] = still.over_force(self.windows[k], got, members)
        for w, error, scale in zip(self.windows, outer.explained(self.windows, contact, rest), times, strict=True):
            if w.trial in judged:
                yield self._told(w, error * scale, np.zeros(0))

    def fit(self, members: Sequence[str], among: NDArray[np.bool_] | None = None) -> Fit:
        """Coefficients of a model over some pieces."""
        columns = self.sums.of([m for m in members if m in self.offered])
        h = int(own(self.sums, "=h")[0])
        known = self._physics(members) if self.exact else {}
        got = fit(self.sums, self.weight, columns, among=among, known=known | ({h: self._height()} if self.fixed else {}))
        if self.fixed:
            return got
        # a rung is judged by the whole equation, as the paper's is: its one w2 is fitted there, beside what the effects are known to add
        others = {int(c): float(v) for c, v in zip(got.columns, got.theta, strict=True) if c != h}
        whole = np.array([float(e == "whole") for e in self.sums.equations])
        return fit(self.sums, whole, columns, among=among, known=others)

    def _physics(self, members: Sequence[str]) -> dict[int, float]:
        """Column -> the coefficient that physics fixes."""
        out = dict[int, float]()
        for name in members:
            effect = self.effects[name]
            if name in self.offered and effect.values is None and all(p.physics is not None for p in effect.parameters):
                out |= {int(c): float(p.physics or 0.0) for c, p in zip(own(self.sums, name), effect.parameters, strict=True)}
        return out

    def _height(self) -> float:
        """z over g at the mean height [s2]."""
        return float(np.mean([w.height for w in self.windows])) / G

    def _row(self, k: int, got: Fit, members: Sequence[str], motion: _Motion | None) -> dict[str, Any]:
        w = self.windows[k]
        miss = self._free(got, members, motion) if motion is not None else np.zeros(0)
        return self._told(w, self.error(w, got, members) * self.over_force(w, got, members), miss)

    def _told(self, w: Weak, error: Array, miss: Array) -> dict[str, Any]:
        return {
            "trial": w.trial, "subject": w.subject, "task": w.task, "condition": w.condition, "axis": w.axis, "windows": len(error),
            "square_sum": float(error @ error), "free_run_frames": len(miss), "free_run_square_sum": float(miss @ miss),
        }  # fmt: skip

    def over_force(self, w: Weak, got: Fit, members: Sequence[str]) -> Array | float:
        """What makes an error over one w2 that of the moment over the vertical force [1]: 1 where the height is taken as constant."""
        h = float(self._used(got, members)[own(self.sums, "=h")[0]])
        return 1.0 / (h * w.w2) if self.exact and "height" in members and w.w2 is not None and h > 0 else 1.0

    def error(self, w: Weak, got: Fit, members: Sequence[str]) -> Array:
        """Error of a model's equation in each window, as ZMP [m]: (x - p) less what the model gives."""
        one = sums_design(w, self.offered, self.sums)
        theta = self._used(got, members)
        return np.asarray(one[1] - one[0] @ theta)

    def _used(self, got: Fit, members: Sequence[str]) -> Array:
        """Coefficients of all columns, the constants only where the model has an effect that is one."""
        theta = np.zeros(len(self.sums.columns))
        theta[got.columns] = got.theta
        theta[own(self.sums, *self._silent(members))] = 0.0
        return theta

    def _silent(self, members: Sequence[str]) -> set[str]:
        """Constants that stay in the residual."""
        if self.evaluation["offset"] == "train" or any(p.name == "x" for m in members for p in self.effects[m].parameters):
            return set()
        out = set() if "com_bias" in members or "offset" in members else {"=moment"}
        return out if "tilt" in members else {*out, "=kinematic"}

    def _free(self, got: Fit, members: Sequence[str], motion: _Motion) -> Array:
        """Free run less the CoM as measured, frame by frame [m]."""
        theta = dict(zip([n for n, _ in self.sums.columns], range(len(self.sums.columns)), strict=True))
        used = self._used(got, members)
        h = float(used[theta["=h"]])
        if not h > 0:
            return np.zeros(0)
        c, p = motion.channels, motion.plant.p
        shift = used[theta["=moment"]] - h * used[theta["=kinematic"]]
        for name in members:
            effect = self.effects[name]
            if name not in self.offered or effect.columns is None:
                continue
            here = used[own(self.sums, name)]
            if effect.settled and effect.undo:
                c = effect.undo(c, here)
                continue
            shift = shift - h * (effect.columns(replace(c, w2=1 / h)) @ here)
        zmp = np.where(np.isfinite(motion.plant.p), c.zmp_x, np.nan) + shift
        plant = replace(motion.plant, p=np.where(np.isfinite(zmp), zmp, p))
        free = free_runs(plant, 1.0 / h)
        miss = free - (c.com_x if not np.array_equal(c.com_x, motion.channels.com_x) else plant.x)
        return np.asarray(miss[np.isfinite(miss)])

    def contributions(self, chosen: Models, near: Sequence[str]) -> pd.DataFrame:
        """Rows of `contributions`: models fitted to all trials."""
        last = chosen[-1][1] if chosen else ()
        fits = {"before": ((), self.fit(()))} | {f"after {name}": (members, self.fit(members)) for name, members in chosen}
        beside = {n: self.fit((*(m for m in last if m != n), n)) for n in near if n in self.offered}
        return joined("contributions", [self._shown(w, fits, beside) for w in self.windows])

    def _shown(self, w: Weak, fits: Mapping[str, tuple[Sequence[str], Fit]], beside: Mapping[str, Fit]) -> pd.DataFrame:
        about = {"trial": w.trial, "subject": w.subject, "task": w.task, "condition": w.condition, "axis": w.axis}
        out: dict[str, Any] = {**about, "frame": w.frame, "time": w.time, "com": w.com, "velocity": w.velocity}
        out |= {name: self.error(w, got, members) for name, (members, got) in fits.items()}
        columns, _ = sums_design(w, self.offered, self.sums)
        for name, got in beside.items():
            theta = np.zeros(len(self.sums.columns))
            theta[got.columns] = got.theta
            mine = own(self.sums, name)
            out[f"effect {name}"] = columns[:, mine] @ theta[mine]
        return pd.DataFrame(out)


def sums_design(w: Weak, offered: Sequence[str], s: Sums) -> tuple[Array, Array]:
    """Columns and left side of the whole equation as the sums were made."""
    return design(w, "whole", offered, s.w2, s.h)
