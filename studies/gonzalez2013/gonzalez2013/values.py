"""Table I and the tracks of figs. 3 and 4 from the pipeline's tables, with the truth beside them."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gonzalez2013.chain import Scene, scene
from gonzalez2013.estimators import PAPER, Told
from plumbline import body, contact, forces, support
from plumbline.markerset import MarkerSet
from plumbline.models import stability
from plumbline.signals import Recording

Array = NDArray[np.float64]

AXES = {"forward": 1, "lateral": 0, "up": 2}  # the paper's x, y, z are our y, x, z
JUDGED = ("volume", "sts")
HALF = 0.06  # [s] over which a speed is taken


def published(path: str | Path) -> pd.DataFrame:
    """The paper's numbers: item, motion, value, unit, meaning."""
    return pd.read_csv(path, sep="\t")


def scenes(recordings: Mapping[str, Recording], markerset: MarkerSet, sex: str = "") -> dict[str, Scene]:
    """What the estimators get of recordings, by task."""
    mass = float(np.median([r.mass for r in recordings.values()]))
    out = {}
    for task, r in recordings.items():
        made = body.build(r.markers, markerset, sex)
        standing = contact.of_feet(r.markers, support.feet(r.markers, markerset), r.time)
        out[task] = scene(made, forces.net(r.plates, r.time, standing), r.time, mass)
    return out


def truth(folder: str | Path, trial: str, time: Array) -> Array:
    """True CoM [m], (n, 3), at the frames of a trial."""
    known = pd.read_parquet(Path(folder) / f"{trial}.parquet")
    return np.column_stack([np.interp(time, known["time"], known[f"com_{a}"]) for a in "xyz"])


def fitted(given: Mapping[str, Scene]) -> dict[str, Told]:
    """Each estimator calibrated on the paper's 300 s."""
    return {name: e.fit([given["static"]]) for name, e in PAPER.items()}


def items(com: Array, sd: Array, true: Array) -> dict[str, float]:
    """Numbers of Table I in its units (mm, %).  com, sd, true: (n, 3) [m].

    The relative standard error (eq. 13) is taken as rms predicted sd over rms distance from the middle between the ankles, axis by axis:
    our reading, as the text says sd over size.
    """
    e = com - true
    out = {f"rmse_{k}": 1e3 * float(np.sqrt(np.mean(e[:, i] ** 2))) for k, i in AXES.items()}
    out["distance"] = 1e3 * float(np.linalg.norm(e, axis=1).mean())
    size = np.sqrt(np.mean(com**2, axis=0))
    out |= {f"relative_{k}": 100 * float(np.sqrt(np.mean(sd[:, i] ** 2)) / size[i]) for k, i in AXES.items()}
    return out | {"ground": 1e3 * float(np.linalg.norm(e[:, :2], axis=1).mean())}


def table_one(paper: pd.DataFrame, given: Mapping[str, Scene], told: Mapping[str, Told], true: Mapping[str, Array]) -> pd.DataFrame:
    """All rows of Table I: item, motion, unit, paper, and a column per estimator.  true: CoM [m] (n, 3) by motion."""
    columns = {(name, motion): items(*f(given[motion]), true[motion]) for name, f in told.items() for motion in JUDGED}
    out = paper[["item", "motion", "unit"]].assign(paper=paper["value"])
    for name in told:
        out[name] = [columns[name, motion][item] for item, motion in zip(paper["item"], paper["motion"], strict=True)]
    return out


def tracks(signals: pd.DataFrame, own: pd.DataFrame, true: Mapping[str, Array]) -> pd.DataFrame:
    """Fig. 3: task, time, and per axis true, table, own, sd [m].

    signals: rows of the judged trials with com_table_*.  own: table `sesc`.
    """
    return pd.concat(_tracks(signals, own, true), ignore_index=True)


def _tracks(signals: pd.DataFrame, own: pd.DataFrame, true: Mapping[str, Array]) -> Iterator[pd.DataFrame]:
    for task in JUDGED:
        s, mine = signals[signals["task"] == task], own[own["task"] == task]
        made = {"task": task, "time": s["time"].to_numpy()}
        for a, i in zip("xyz", range(3), strict=True):
            made |= {f"true_{a}": true[task][:, i], f"table_{a}": s[f"com_table_{a}"].to_numpy()}
            made |= {f"own_{a}": mine[f"com_sesc_{a}"].to_numpy(), f"sd_{a}": mine[f"com_sesc_sd_{a}"].to_numpy()}
        yield pd.DataFrame(made)


def stable(signals: pd.DataFrame, lines: pd.DataFrame, feet: Mapping[str, Array]) -> pd.DataFrame:
    """Fig. 4, standing up, forward axis: time, back, front [m], share under the feet [1]; and of true, table, own CoM x [m], omega
    [rad/s], xi [m], margin [m], step [m].

    feet: vertical load under the feet and of all [N], (n,) each, "feet" and "all".
    """
    s, track = signals[signals["task"] == "sts"], lines[lines["task"] == "sts"]
    time, back, front = (s[k].to_numpy(float) for k in ("time", "limit_back", "limit_front"))
    out = {"time": time, "back": back, "front": front, "carried": feet["feet"] / feet["all"]}
    for name in ("true", "table", "own"):
        x, z = track[f"{name}_y"].to_numpy(), track[f"{name}_z"].to_numpy()
        omega = stability.natural(z)
        xi = stability.extrapolated(x, stability.speed(x, time, HALF), omega)
        out |= {f"{name}_x": x, f"{name}_omega": omega, f"{name}_xi": xi}
        out |= {f"{name}_margin": stability.margin(xi, back, front), f"{name}_step": stability.step(xi, back, front)}
    return pd.DataFrame(out)


def write(table: pd.DataFrame, path: str | Path) -> None:
    """A table as text, five digits."""
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, sep="\t", index=False, float_format="%.5g", lineterminator="\n")
