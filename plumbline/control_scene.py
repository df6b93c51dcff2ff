"""What laws are simulated against: a group's loci with the faults of instruments taken out and what drives the CoM accounted for."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import law as laws
from plumbline.batch import Batch, slow
from plumbline.criticism import Outside
from plumbline.effects import Effect
from plumbline.effects._channels import Channels, Person, of_trial, persons
from plumbline.estimators import saturation
from plumbline.groups import Group, Key, of_loci, regimes
from plumbline.models.loop import Scene
from plumbline.physics import G
from plumbline.plant import rows_of, sampling_rate
from plumbline.weak import Bump

Array = NDArray[np.float64]
Regime = NDArray[np.int8]
Sizes = Mapping[str, Sequence[float]]
"""Effect -> its parameters where it can undo itself, else the coefficients of its columns."""

FEWEST_LOCI, FEWEST_TRIALS = 4, 2
LEAST_INSIDE = 0.2  # share of frames between the limits below which the regimes are not believed
PASSED = 0.01  # [m] by which the ZMP must go beyond a limit for it to be none
LATE = 0.1  # [s]
HALF_WIDTH, EXPONENT = 0.3, 4  # of the bumps that omega is fitted with again [s]
REFITS = 2  # what an effect takes off the ZMP depends on omega
BEND = 5.0  # [Hz] smoother of what else moves the body: L' is made of unfiltered markers


class Stage(NamedTuple):
    """A group's loci that do not fall, ready to be simulated; base: d, k1, k2 to begin from, late: those of a law that acts LATE;
    trials: of each locus; shift: time [s] by which instruments were put right."""

    scene: Scene
    base: Array
    late: Array
    trials: tuple[str, ...]
    shift: float = 0.0

    def take(self, loci: NDArray[np.bool_]) -> "Stage":
        """Some of the loci."""
        return self._replace(scene=self.scene.take(loci), trials=tuple(t for t, kept in zip(self.trials, loci, strict=True) if kept))


def staged(
    about: Mapping[str, str],
    loci: pd.DataFrame,
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    coverage: pd.DataFrame,
    trust: pd.DataFrame,
    clusters: pd.DataFrame,
    controller: pd.DataFrame,
    known: "Known",
) -> Stage | str:
    """The stage of one group, or why it cannot be judged."""
    row = _law_row(controller[np.logical_and.reduce([controller[k] == v for k, v in about.items()])])
    if isinstance(row, str):
        return row
    used = clusters[clusters["gains"] & ((clusters["cluster"] == row["cluster"]) | (row["cluster"] == 0))]
    mine = loci.merge(used[["trial", "locus"]], on=["trial", "locus"])
    if len(mine) < FEWEST_LOCI or mine["trial"].nunique() < FEWEST_TRIALS:
        return f"{len(mine)} loci of {mine['trial'].nunique()} trials can be simulated; {FEWEST_LOCI} of {FEWEST_TRIALS} are needed"
    raw = signals[signals["trial"].isin(set(mine["trial"]))]
    key = Key(**about)
    person = persons(signals, coverage)[about["subject"]]

    def groups(omega: float, shift: float = 0.0) -> Iterator[tuple[Group | None, pd.DataFrame]]:
        """Loci and signals with the faults taken out; the same as the ZMP alone would have to drive them."""
        frames = _applied(raw, coverage, person, known.effects, known.faults, omega, _taken_out)
        for moved in (False, True):
            table = _applied(frames, coverage, person, known.effects, known.plant if moved else {}, omega, _driven)
            table = _carried(table, coverage, known.contact) if moved and known.contact else table
            yield next(of_loci(table.assign(zmp_x=table["zmp_x"] + shift), pushes, mine, {key: omega}), None), table

    omega, shift = float(row["omega"]), 0.0
    for _ in range(REFITS):
        (group, _), (_, driven) = groups(omega)
        if group is None or group.steady.sum() < FEWEST_LOCI:
            return "too few loci have an unbroken CoM and ZMP"
        omega = _omega(driven, group, omega) if known.anew else omega
        shift = _constant(group.batch, omega)
    (group, frames), (moved, _) = groups(omega, shift)
    if group is None or moved is None:
        return "too few loci have an unbroken CoM and ZMP"
    group = replace(group, batch=replace(moved.batch, p=group.batch.p)) if known.moved else group
    stage = _with_base(group, frames, trust if not (known.faults or known.contact) else None, row, omega)
    return stage if isinstance(stage, str) else stage._replace(shift=_shift(known))


def _shift(known: "Known") -> float:
    """Largest time among the faults taken out [s]."""
    late = [name for name in known.faults if known.effects[name].parameters[0].unit == "s"]
    return max((abs(known.faults[name][0]) for name in late), default=0.0)


def _omega(frames: pd.DataFrame, group: Group, before: float) -> float:
    """Natural frequency [rad/s] that the loci of a group have once faults and other effects are taken out, a constant free in each.

    The one in the table `controller` is of the signals as recorded.  before: kept where the loci cannot tell.
    """
    top = bottom = 0.0
    rows = frames.groupby("trial", sort=False, observed=True).indices
    for j, trial in enumerate(group.loci["trial"]):
        table = rows_of(frames, rows[trial])
        time, x, p = (table[c].to_numpy(float) for c in ("time", "com_x", "zmp_x"))
        length = (group.batch.end[j] - group.batch.lead - 1) / group.batch.rate
        mine = (time > group.starts[j] - 1e-9) & (time < group.starts[j] + length + 1e-9)
        bump = Bump(HALF_WIDTH, EXPONENT, sampling_rate(time))
        pull, lever = bump.apply(bump.curvature, x[mine]), bump.apply(bump.value, (x - p)[mine])
        good = np.isfinite(pull + lever)
        if good.any():
            pull, lever = (one[good] - one[good].mean() for one in (pull, lever))
            top, bottom = top + float(pull @ lever), bottom + float(lever @ lever)
    return float(np.sqrt(top / bottom)) if top > 0 and bottom > 0 else before


def _constant(batch: Batch, omega: float) -> float:
    """Constant by which the recorded x - p is too large [m], median of the loci: x'' = w2 (x - p - c) over each one's length.

    An offset of one of them says nothing of the law, but the smoother of x' would take it for a motion of the plant.
    """
    each = []
    for j, end in enumerate(batch.end):
        x, v, p = (a[batch.lead : end, j] for a in (batch.x, batch.v, batch.p))
        each.append(np.mean(x - p) - (v[-1] - v[0]) * batch.rate / (omega**2 * len(x)))
    return float(np.median(each))


class Known(NamedTuple):
    """What the plant ledger has found: faults of instruments, and what drives the CoM beside the ZMP.

    contact: beside the plates, None where there is none.
    """

    faults: Sizes
    plant: Sizes
    effects: Mapping[str, Effect]
    contact: Outside | None = None

    @property
    def moved(self) -> bool:
        """Whether something drives the CoM beside the ZMP."""
        return bool(self.plant or self.contact)

    @property
    def anew(self) -> bool:
        """Whether the omega of the signals as recorded does not hold."""
        return bool(self.faults or self.moved)


def _law_row(rows: pd.DataFrame) -> "pd.Series[Any] | str":
    """The row of `controller` with most loci whose gains are known, or why there is none."""
    plain = rows[(rows["method"] == "output error") & rows["k1"].notna() & (rows["omega"] > 0)]
    if len(plain):
        return plain.sort_values("loci").iloc[-1]
    said = [w for w in rows["warning"] if w]
    return said[0] if said else "the controller was not identified"


Change = Callable[[Channels, Effect, Array], Channels]


def _applied(
    frames: pd.DataFrame, coverage: pd.DataFrame, person: Person, known: Mapping[str, Effect], sizes: Sizes, omega: float, change: Change
) -> pd.DataFrame:
    """Signals of one subject with the lateral CoM and ZMP changed by effects of known sizes."""
    if not sizes:
        return frames
    mass = dict(zip(coverage["trial"], coverage["mass"], strict=True))
    # delays first: the others are told by a force that is in time
    names = sorted(set(sizes) & set(known), key=lambda n: (known[n].parameters[0].unit != "s", n))
    pieces = []
    for trial, one in frames.groupby("trial", sort=False, observed=True):
        channels = replace(of_trial(one, "lateral", float(mass.get(trial, np.nan)), person), w2=omega**2)
        for name in names:
            channels = change(channels, known[name], np.asarray(sizes[name], float))
        pieces.append(one.assign(com_x=channels["com_x"], zmp_x=channels["zmp_x"]))
    return pd.concat(pieces)


def _taken_out(c: Channels, effect: Effect, theta: Array) -> Channels:
    """A fault of an instrument undone; one that cannot undo itself is in the recorded ZMP what it adds to x'', over w2."""
    return effect.undo(c, theta) if effect.undo is not None else _driven(c, effect, theta)


def _driven(c: Channels, effect: Effect, theta: Array) -> Channels:
    """The ZMP that alone would move the CoM as the measured one does together with the effect."""
    if effect.columns is None:
        return c
    return c.changed(zmp_x=c["zmp_x"] - slow(np.nan_to_num(effect.columns(c)) @ theta, c.rate, BEND) / c.w2)


def _carried(frames: pd.DataFrame, coverage: pd.DataFrame, contact: Outside) -> pd.DataFrame:
    """Signals of one subject with the ZMP that the plates would have shown had they carried a contact too, while it acts.

    x - p = h x'' - (he/g) Fe/m + (xe - p) We/(m g), with Fe to the side at height he and We carried at xe.
    """
    weight = dict(zip(coverage["trial"], coverage["mass"] * G, strict=True))
    line = {k: v if np.isfinite(v) else 0.0 for k, v in contact.line.items()}
    zmp = frames["zmp_x"].to_numpy(float).copy()
    for trial, rows in frames.groupby("trial", sort=False, observed=True).indices.items():
        frame = frames["frame"].to_numpy()[rows]
        for first, last in contact.acts.get(str(trial), ()):
            at = rows[(frame >= first) & (frame <= last)]
            carried = line.get("force", 0.0) * (line.get("x", 0.0) - zmp[at])
            zmp[at] += (carried - line.get("lateral", 0.0) * line.get("height", 0.0)) / weight[trial]
    return frames.assign(zmp_x=zmp)


def _with_base(group: Group, frames: pd.DataFrame, trust: pd.DataFrame | None, row: "pd.Series[Any]", omega: float) -> Stage | str:
    """The stage from a group's batch.  trust: for its regimes; None to find them anew."""
    steady = group.steady
    regime = regimes(group, trust) if trust is not None else None
    if regime is None:
        found = laws.regimes(group.batch, omega, steady)
        if found is None:
            return "the gains cannot be told from these loci"
        regime = found.regime
    inside = group.batch.inside & steady
    ends = laws.limits(group.batch, regime)
    reached = float(group.batch.p[inside].min()), float(group.batch.p[inside].max())
    if np.mean(regime[inside] == 0) < LEAST_INSIDE:  # a ZMP that is held was taken for one at its limit
        regime, ends = np.zeros_like(regime), ends._replace(left=-np.inf, right=np.inf)
    # a limit at which no regime was found may have been touched: the ZMP was never seen beyond
    limits = tuple(e if np.isfinite(e) else r for e, r in zip((ends.left, ends.right), reached, strict=True))
    limits, regime = _unpassed(group.batch.p, regime, limits, reached)
    batch, thin = laws.thinned(group.batch.take(steady), regime[:, steady])
    batch = replace(batch, p=_impulse(group.batch.take(steady), batch))
    start = saturation.fit(group.batch.take(steady))
    if start is not None and np.isfinite(start.law.d):
        base = np.array([start.law.d, start.law.k1, start.law.k2])
    else:
        base = row[["reference", "k1", "k2"]].to_numpy(float)
    begun, area = _begun(group, frames)
    scene = Scene(batch, thin, omega, (limits[0], limits[1]), begun[steady], area[steady])
    return Stage(scene, base, _late(scene, base), tuple(group.loci["trial"][steady].astype(str)))


def _unpassed(p: Array, regime: Regime, limits: Sequence[float], reached: Sequence[float]) -> tuple[tuple[float, ...], Regime]:
    """Limits and regimes, a limit that the ZMP passed put where it was reached: what lies short of it was a turn, taken for a limit."""
    out, regime = [], regime.copy()
    for side, limit, end in zip((-1, 1), limits, reached, strict=True):
        passed = side * (end - limit) > PASSED
        out.append(end if passed else limit)
        if passed:
            regime[(regime == side) & (side * (end - p) > PASSED)] = 0
    return tuple(out), regime


def _impulse(fine: Batch, coarse: Batch) -> Array:
    """ZMP of each coarse frame with triangular weights over a step to both sides: what drives the plant between frames is kept whole.

    Else the fast part of the ZMP, which the velocity carries and the coarse ZMP does not, would look like a law's.
    """
    step = round(fine.rate / coarse.rate)
    first = fine.lead % step
    weight = np.concatenate([np.arange(1, step + 1), np.arange(step - 1, 0, -1)]) / step**2
    padded = np.concatenate([fine.p[:1].repeat(step, 0), fine.p, fine.p[-1:].repeat(step, 0)])
    out = np.array(coarse.p)
    for i in range(coarse.lead + 1, len(out)):
        at = first + i * step + step
        out[i] = np.tensordot(weight, padded[at - step + 1 : at + step], 1)
    return out


def _late(scene: Scene, base: Array) -> Array:
    """d, k1, k2 by least squares of the ZMP on the state LATE before; the base where they cannot be told."""
    batch, inside = scene.batch.late(LATE), scene.batch.inside & (scene.regime == 0)
    solved = saturation.linear(batch.x[inside], batch.v[inside], batch.p[inside])
    if solved is None or solved[1] <= 1.05:
        return base
    return np.array([solved[0] / (1 - solved[1]), solved[1], solved[2]])


def _begun(group: Group, frames: pd.DataFrame) -> tuple[Array, Array]:
    """Time from each record's start to the locus [s], and the integral of the measured CoM over it [m s], both (m,)."""
    rows = frames.groupby("trial", sort=False, observed=True).indices
    begun, area = np.zeros(len(group.starts)), np.zeros(len(group.starts))
    for j, (trial, start) in enumerate(zip(group.loci["trial"], group.starts, strict=True)):
        table = rows_of(frames, rows[trial])
        time, x = table["time"].to_numpy(float), table["com_x"].to_numpy(float)
        begun[j] = start - time[0]
        before = (time <= start) & np.isfinite(x)
        area[j] = float(x[before].mean()) * begun[j] if before.any() else 0.0
    return begun, area
