r"""The paper's numbers, what was identified, the truth; and what the paper's numbers say about its subject.

Point mass at height z: :math:`\omega^2 = (\ddot z + g)/z` (Murai 2013, eq. 2). With angular momentum L about the CoM
:math:`\ddot x = \frac{\ddot z + g}{z}(x - p) - \frac{\dot L}{m z}`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from plumbline.models.controller import damping, poles
from plumbline.physics import G

HEIGHT, MASS = 1.81, 70.0  # [m], [kg] of the paper's subject
COM_SHARE = 0.56  # [1] CoM height over body height while standing
LOW = 0.95  # [m] a CoM lowered by some 6 cm
LEVER = 0.10  # [m] distance of CoM and ZMP at which the angular momentum is asked for
METHOD = "output error"  # the consistent estimator that simulates; gains are quoted from it
QUANTITY = {"omega_far": "omega", "omega_near": "omega", "k1": "k1", "k2": "k2", "reference": "reference"}
QUANTITY |= {"limit_left": "limit_left", "limit_right": "limit_right"}


def published(path: str | Path) -> pd.DataFrame:
    """The paper's numbers: item, condition, value, unit, meaning."""
    return pd.read_csv(path, sep="\t")


def numbers(paper: pd.DataFrame, controller: pd.DataFrame) -> pd.DataFrame:
    """What was identified beside what the paper prints.

    paper: :func:`published`.  controller: its table.  Columns: item, condition, unit, paper, identified, low, high (95 %), difference
    (identified less the paper's), note. The paper prints no reference and no limits: NaN there.
    """
    known = paper.set_index(["item", "condition"])["value"].to_dict()
    unit = dict(zip(paper["item"], paper["unit"], strict=True)) | dict.fromkeys(("reference", "limit_left", "limit_right"), "m")
    rows = []
    for condition in sorted(set(paper["condition"])):
        mine = controller[controller["condition"] == condition]
        for item, column in QUANTITY.items():
            value, low, high, note = _found(mine, item, column)
            printed = known.get((item, condition), np.nan)
            rows.append((item, condition, unit[item], printed, value, low, high, value - printed, note))
    return pd.DataFrame(rows, columns=["item", "condition", "unit", "paper", "identified", "low", "high", "difference", "note"])


def _found(mine: pd.DataFrame, item: str, column: str) -> tuple[float, float, float, str]:
    """Value, interval and a note: omega from its cluster, the law from the cluster of the largest omega."""
    rows = chosen(mine)
    if rows.empty:
        return np.nan, np.nan, np.nan, "not identified"
    row = rows.iloc[0 if item == "omega_far" else -1]
    note = "" if len(rows) == 2 or column != "omega" else f"{len(rows)} cluster{'s' * (len(rows) > 1)} found"
    return float(row[column]), float(row[f"{column}_low"]), float(row[f"{column}_high"]), note


def chosen(controller: pd.DataFrame) -> pd.DataFrame:
    """One row per cluster of one group in the order of omega, by the estimator quoted; the whole group where it is one cluster.

    Limits belong to the feet, not to omega: each is taken from the row that knows it best (narrowest interval).
    """
    mine = controller[controller["method"] == METHOD].sort_values("omega")
    parts = mine[mine["cluster"] > 0] if (mine["cluster"] > 0).any() else mine.assign(cluster=1)
    for side in ("limit_left", "limit_right"):
        known = mine[mine[f"{side}_low"].notna()]
        if len(known):
            best = known.iloc[int((known[f"{side}_high"] - known[f"{side}_low"]).to_numpy().argmin())]
            parts = parts.assign(**{c: best[c] for c in (side, f"{side}_low", f"{side}_high")})
    return parts


def with_truth(found: pd.DataFrame, truth: Mapping[str, Any]) -> pd.DataFrame:
    """The table of :func:`numbers` with the columns truth and error (identified less the truth).  truth: content of truth.json."""
    told = [_told(item, truth["conditions"][condition], truth) for item, condition in zip(found["item"], found["condition"], strict=True)]
    out = found.assign(truth=told)
    return out.assign(error=out["identified"] - out["truth"])


def _told(item: str, condition: Mapping[str, float], truth: Mapping[str, Any]) -> float:
    general = {"reference": truth["d"], "limit_left": truth["left"], "limit_right": truth["right"]}
    return float(general[item] if item in general else condition[item.removeprefix("omega_")])


def switching(parts: pd.DataFrame, truth: Mapping[str, Any]) -> pd.DataFrame:
    """How far the switching points are from the true ones: one row per method.

    parts: table `trust`.  Columns: method, true (switches of the truth inside its loci), found; median, p90, largest [s] of the distance
    of each one found from the nearest true one of its locus.
    """
    told = {locus["trial"]: np.array(locus["switches"]) for locus in truth["loci"]}
    ends = parts.groupby("trial")["end"].max()
    true = {trial: at[at < ends[trial]] for trial, at in told.items() if trial in ends.index}
    rows = []
    for method, column in (("change point", "found"), ("returning pass", "rls")):
        seen = parts[parts[column].notna()]
        near = [np.abs(true[trial] - at).min() for trial, at in zip(seen["trial"], seen[column], strict=True) if len(true[trial])]
        median, p90, largest = np.quantile(near, [0.5, 0.9, 1.0]) if near else (np.nan, np.nan, np.nan)
        rows.append((method, sum(map(len, true.values())), len(seen), median, p90, largest))
    return pd.DataFrame(rows, columns=["method", "true", "found", "median", "p90", "largest"])


def groups(controller: pd.DataFrame) -> pd.DataFrame:
    """The rows of `controller` that the study quotes, one per condition and cluster."""
    return pd.concat([chosen(mine) for _, mine in controller.groupby("condition", sort=True)] or [controller], ignore_index=True)


def write(table: pd.DataFrame, path: str | Path) -> None:
    """Write a small table as text, 9 digits."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, sep="\t", index=False, float_format="%.9g", na_rep="n/a")


def read(path: str | Path) -> pd.DataFrame:
    """Read what :func:`write` wrote."""
    return pd.read_csv(path, sep="\t").fillna({"note": ""})


# -- what the paper's own numbers say ---------------------------------------------------------------------------------


def plausibility(paper: pd.DataFrame) -> pd.DataFrame:
    """Each published omega against a man of 1.81 m and 70 kg.

    Columns: condition, item, omega [rad/s]; height [m], g/omega^2: where a point mass would be; expected [m], of a standing man;
    omega_expected [rad/s] there and omega_low [rad/s] at :data:`LOW`; z_ddot [m/s2] that omega asks for at :data:`LOW`; sink [m]
    in half a second of it; ang_mom_rate [N m] that it asks for instead at z = 1 m and x - p = :data:`LEVER`.
    """
    rows = paper[paper["item"].str.startswith("omega")]
    omega = rows["value"].to_numpy(float)
    expected = COM_SHARE * HEIGHT
    return pd.DataFrame(
        {
            "condition": rows["condition"], "item": rows["item"], "omega": omega,
            "height": height(omega), "expected": expected,
            "omega_expected": frequency(expected), "omega_low": frequency(LOW),
            "z_ddot": vertical(omega, LOW), "sink": -vertical(omega, LOW) * 0.5**2 / 2,
            "ang_mom_rate": ang_mom_rate(omega, 1.0, LEVER),
        }
    ).reset_index(drop=True)  # fmt: skip


def height(omega: Any) -> Any:
    """Height of a point mass with this omega [m], g/omega^2."""
    return G / omega**2


def frequency(z: float) -> float:
    """omega of a point mass at height z [m] that stays there [rad/s]: it grows as z falls."""
    return float(np.sqrt(G / z))


def vertical(omega: Any, z: float) -> Any:
    """z'' [m/s2] with which a point mass at height z [m] has this omega [rad/s], omega^2 z - g (eq. 2)."""
    return omega**2 * z - G


def ang_mom_rate(omega: Any, z: float, lever: float) -> Any:
    """L' [N m] that turns g/z into omega^2 at x - p = lever [m]: m z (g/z - omega^2) (x - p)."""
    return MASS * z * (G / z - omega**2) * lever


def damped(paper: pd.DataFrame) -> pd.DataFrame:
    """Poles -omega q of the published gains: condition, omega, k1, k2, q_real, q_imag (q1, q2 are conjugate), damping [1]."""
    rows = []
    for condition, mine in paper.groupby("condition", sort=True):
        value = dict(zip(mine["item"], mine["value"], strict=True))
        about = value["k1"], value["k2"], value["omega_near"]
        q = poles(*about)[0]
        rows.append((condition, about[2], about[0], about[1], q.real, q.imag, damping(*about)))
    return pd.DataFrame(rows, columns=["condition", "omega", "k1", "k2", "q_real", "q_imag", "damping"])
