"""Clusters of omega, and the controller of each: tables `clusters`, `choice` and `controller`.

Loci of one subject, task and condition are clustered by the w2 that each gives alone; the number of clusters is what predicts loci left
out. Batch least squares gives one omega per cluster; the gains come from those of its loci that do not fall. Limits belong to the feet,
not to omega, and are taken over all loci of the group.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import stdtrit

from plumbline import law as laws
from plumbline import mixture, tables
from plumbline.estimators.clustered import reach
from plumbline.fit import Windows, solve, windows
from plumbline.groups import Group, Key, by_group, of_loci, regimes
from plumbline.models.com_zmp import PlantFit
from plumbline.models.controller import Law, poles

Array = NDArray[np.float64]

FEWEST = 3  # loci behind gains
SURE = 0.95  # [1] share of a cluster from which on a locus counts in its omega and gains: a short fall has a wide se, but a long lever


def of_part(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    coverage: pd.DataFrame,
    trust: pd.DataFrame,
    evaluation: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Tables `clusters`, `choice`, `controller` of whole subjects."""
    members: list[pd.DataFrame] = []
    choices: list[dict[str, Any]] = []
    rows: list[dict[str, Any]] = []
    of_group = group_windows(signals, pushes, loci, coverage, evaluation)
    for key, mine in by_group(loci):
        about, weak = key._asdict(), of_group.get(key, [])
        table, choice = _clustered(mine, weak)
        choices += [about | c for c in choice]
        rows += list(_controllers(about, table, weak, signals, pushes, mine, trust))
        members.append(table.drop(columns=["w2", "w2_se"]))
    return (
        tables.joined("clusters", members),
        pd.DataFrame(choices) if choices else tables.empty("choice"),
        pd.DataFrame(rows) if rows else tables.empty("controller"),
    )


def group_windows(
    signals: pd.DataFrame, pushes: pd.DataFrame, loci: pd.DataFrame, coverage: pd.DataFrame, evaluation: Mapping[str, Any]
) -> dict[Key, list[Windows]]:
    """Lateral test functions of every trial with loci, by (subject, task, condition)."""
    chosen = set(loci["trial"])
    mine = signals[signals["trial"].isin(chosen)]
    out: dict[Key, list[Windows]] = {}
    for w in windows(mine, pushes, loci, coverage[coverage["trial"].isin(chosen)], evaluation, axes=("lateral",)):
        out.setdefault(Key(w.subject, w.task, w.condition), []).append(w)
    return out


def plant_of(weak: Sequence[Windows], chosen: set[tuple[str, int]] | None = None) -> PlantFit | None:
    """Batch least squares of w2 over the test functions inside loci; chosen: (trial, locus), None for all."""
    picked = []
    for w in weak:
        locus = w.locus[w.picked]
        good = locus > 0
        if chosen is not None:
            good &= np.isin(locus, [number for trial, number in chosen if trial == w.trial])
        picked.append((w, w.picked[good]))
    return solve(picked)


# -- clusters ---------------------------------------------------------------------------------------------------------


def _clustered(loci: pd.DataFrame, weak: Sequence[Windows]) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Rows of `clusters` (with w2 and w2_se) and of `choice` for one group."""
    of_trial = {w.trial: w for w in weak}
    rows = [_alone(locus, of_trial.get(locus["trial"])) for _, locus in loci.iterrows()]
    table = pd.DataFrame(rows)
    known = (np.isfinite(table["w2_se"]) & (table["w2"] > 0)).to_numpy()
    if not known.any():
        return table, []
    w2, se = (table.loc[known, c].to_numpy(float) for c in ("w2", "w2_se"))
    choice = mixture.choose(w2, se)
    posterior = choice.mixture.posterior(w2, se)
    table.loc[known, "cluster"] = posterior.argmax(1) + 1
    table.loc[known, "share"] = posterior.max(1)
    tried = [
        {"number": int(k), "score": float(s), "gain_se": float(e), "chosen": int(k) == len(choice.mixture.centre)}
        for k, s, e in zip(choice.number, choice.score, choice.gain_se, strict=True)
    ]
    return table, tried


def _alone(locus: pd.Series, weak: Windows | None) -> dict[str, Any]:
    """What one locus says of omega."""
    nan = float("nan")
    row = {k: locus[k] for k in ("trial", "subject", "task", "condition", "locus", "kind")}
    row |= {"reach": nan, "omega": nan, "omega_low": nan, "omega_high": nan, "w2": nan, "w2_se": nan}
    row |= {"cluster": 0, "share": nan, "gains": False, "note": "no test function fits into it"}
    if weak is None:
        return row | {"note": "its trial has no weak plant equation: see `fit`"}
    inside = weak.locus == locus["locus"]
    far = np.abs(weak.plant.x[inside] - locus["reference"])
    row["reach"] = float(np.nanmax(far)) if np.isfinite(far).any() else nan
    picked = weak.picked[weak.locus[weak.picked] == locus["locus"]]
    got = solve([(weak, picked)], blocks=True)
    if got is None:
        return row
    se = weak.plant.w2_se(picked, got.w2)
    if np.isfinite(se):
        low, high = (float(np.sqrt(max(got.w2 + sign * 1.96 * se, 0.0))) for sign in (-1, 1))
    else:  # noise not known: the scatter of the locus' blocks, few and so uncertain themselves
        low, high = got.omega_interval()
        se = float(np.sqrt(got.covariance[0, 0])) * float(stdtrit(max(got.dof, 1), 0.975)) / 1.96
    row |= {"omega": got.omega, "omega_low": low, "omega_high": high, "w2": got.w2, "w2_se": se}
    return row | {"note": "" if got.w2 > 0 else "w2 is not positive"}


# -- controllers ------------------------------------------------------------------------------------------------------


def _controllers(
    about: dict[str, str],
    table: pd.DataFrame,
    weak: Sequence[Windows],
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    trust: pd.DataFrame,
) -> Iterator[dict[str, Any]]:
    """Rows of `controller` for one group; sets `gains` and `note` in `table`."""
    table.loc[table["kind"] == "falling", "note"] = "falls: its ZMP only shows the limit"
    numbers = sorted(set(table["cluster"]) - {0})
    key = Key(**about)
    pooled = plant_of(weak)
    everybody = next(of_loci(signals, pushes, loci, {key: pooled.omega}), None) if pooled is not None and pooled.w2 > 0 else None
    regime = regimes(everybody, trust) if everybody is not None else None
    known = laws.limits(everybody.batch, regime) if everybody is not None and regime is not None else None
    for cluster in numbers if len(numbers) > 1 else [0]:  # gains over loci of several omegas are nobody's
        mine = table if cluster == 0 else table[table["cluster"] == cluster]
        sure = mine[mine["share"] >= SURE]
        mine = sure if len(sure) >= FEWEST else mine
        plant = plant_of(weak, set(zip(mine["trial"], mine["locus"], strict=True)))
        if plant is None or plant.w2 <= 0:
            _note(table, mine.index, None, identified=False)
            yield _blank(about | {"cluster": cluster}) | {"warning": "omega cannot be told from these loci, so neither can the gains"}
            continue
        wanted = loci.merge(mine[["trial", "locus"]], on=["trial", "locus"])
        group = next(of_loci(signals, pushes, wanted, {key: plant.omega}), None)
        regime = regimes(group, trust) if group is not None else None
        rows = list(_rows(about | {"cluster": cluster}, plant, group, regime, known))
        _note(table, mine.index, group, identified=len(rows) > 1)
        yield from rows
    between = ~table["gains"] & (table["note"] == "") & (table["share"] < SURE)
    table.loc[between, "note"] = "its omega could be that of another cluster"


def _note(table: pd.DataFrame, mine: pd.Index, group: Group | None, *, identified: bool) -> None:
    """Say of each locus of a cluster (mine: rows of the table) whether it was used for the gains."""
    rows = table.loc[mine]
    if group is None or not identified:
        table.loc[mine[(rows["note"] == "") & (rows["kind"] != "falling")], "note"] = "the gains cannot be told from these loci"
        return
    steady = group.loci[group.steady]
    used = set(zip(steady["trial"], steady["locus"], strict=True))
    table.loc[mine, "gains"] = [pair in used for pair in zip(rows["trial"], rows["locus"], strict=True)]
    short = [(group.loci.iloc[j], why) for j, why in enumerate(group.shortened) if why]
    for locus, why in [*group.left_out, *short]:
        table.loc[(table["trial"] == locus["trial"]) & (table["locus"] == locus["locus"]), "note"] = why


def _blank(about: dict[str, Any]) -> dict[str, Any]:
    nan = float("nan")
    row = {c.name: {"str": "", "int": 0, "float": nan}[c.kind] for c in tables.TABLES["controller"]}
    return row | about | {"method": "output error"}


def _rows(
    about: dict[str, Any], plant: PlantFit, group: Group | None, regime: NDArray[np.int8] | None, known: laws.Limits | None
) -> Iterator[dict[str, Any]]:
    """One row per method."""
    low, high = plant.omega_interval()
    base = _blank(about) | {"omega": plant.omega, "omega_low": low, "omega_high": high}
    count = int(group.steady.sum()) if group is not None else 0
    got = None
    if group is not None and regime is not None and count >= FEWEST:
        got = laws.identify(group.batch, regime, plant.omega, group.steady, known=known)
    if got is None:
        said = f"{count} loci do not fall and have an unbroken CoM and ZMP; {FEWEST} are needed"
        yield base | {"loci": count, "warning": said if count < FEWEST else "the gains cannot be told from these loci"}
        return
    base |= {"feedback_sd": got.saturation.inside_rms, "loci": count}
    plain, delayed = got.output_error, got.delayed
    base |= _limit_columns(plain.law, got)
    yield base | _gains(plain.law, plain.covariance, plain.loci, plant.omega) | {"error": plain.error, "warning": _warning(got)}
    if delayed is not None:
        row = _gains(delayed.law, delayed.covariance, delayed.loci, plant.omega) | {"error": delayed.error}
        yield base | row | {"method": "output error with delay", "warning": "" if delayed.converged else "the search did not settle"}
    if got.instruments is not None:
        row = _gains(got.instruments.law, got.instruments.covariance, got.instruments.loci, plant.omega)
        yield base | row | {"method": "instruments"}
    least = got.saturation
    row = _gains(least.law, least.covariance, least.loci, plant.omega)
    yield base | row | {"method": "saturation", "warning": "least squares: too small in the gains by feedback noise; for comparison only"}


def _gains(law: Law, covariance: Array, loci: int, omega: float) -> dict[str, Any]:
    names = ("reference", "k1", "k2", "delay")[: len(covariance)]
    row: dict[str, Any] = {}
    for k, name in enumerate(names):
        value, half = law[5 if name == "delay" else k], reach(covariance[k, k], loci)
        row |= {name: value, f"{name}_low": max(value - half, 0.0) if name == "delay" else value - half, f"{name}_high": value + half}
    q1, q2 = poles(law.k1, law.k2, omega) if law.delay == 0 else (complex("nan+nanj"),) * 2
    return row | {"q1_real": q1.real, "q1_imag": q1.imag, "q2_real": q2.real, "q2_imag": q2.imag}


def _limit_columns(law: Law, got: laws.Controller) -> dict[str, float]:
    row: dict[str, float] = {}
    for name, value, se, loci in zip(("limit_left", "limit_right"), (law.left, law.right), got.limit_se, got.limit_loci, strict=True):
        known = np.isfinite(value)
        half = reach(se**2, loci) if known else float("nan")
        row |= {name: value if known else float("nan"), f"{name}_low": value - half, f"{name}_high": value + half}
    return row


def _warning(got: laws.Controller) -> str:
    """Why the gains of the plain law should not be trusted."""
    plain, delayed = got.output_error, got.delayed
    if not plain.converged:
        return "the search did not settle"
    if plain.law.k1 <= 1:
        return "k1 is not above 1: this law does not bring the CoM back"
    if delayed is not None and got.late:
        return f"a delay of {1e3 * delayed.law.delay:.0f} ms lowers the error from {1e3 * plain.error:.2f} to {1e3 * delayed.error:.2f} mm"
    return ""
