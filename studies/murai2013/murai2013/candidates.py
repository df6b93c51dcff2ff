"""Which effects can make the paper's omegas: a man of the paper's size with one candidate at a time, read as the paper reads, and judged.

The man (`plumbline.simulate.human`: fourteen segments, Newton and Euler, no CoM-ZMP equation) has the paper's gains for A and is
pushed, leads beyond his stance and falls. What the paper would print is, for each locus, the least squares of
:math:`\\ddot x = \\omega^2 (x - x_Z)` without a constant over signals low-passed at 2 Hz: the last value of its recursive least squares.
"""

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import criticism, loci, rungs, signals
from plumbline.config import with_defaults
from plumbline.effects import catalogue
from plumbline.figures._style import rows
from plumbline.filters import low_pass
from plumbline.fit import identify
from plumbline.ladder import ladder
from plumbline.recording import assemble
from plumbline.simulate.human import Controller, Habits, Law, draw_touches
from plumbline.simulate.person import Subject, draw_subject
from plumbline.simulate.study import write_study
from plumbline.study import find

Array = NDArray[np.float64]

CUTOFF = 2.0  # [Hz] of the paper's filter
SEED = 2013
DURATION = 13.0  # [s] of one recording
RUNS = (4, 5, 9, 10, 14, 15, 19, 20)  # numbers for which `draw_touches` ends in a fall, or leads him beyond his stance
KINDS = {"near": "recovering", "beyond": "recovering_from_beyond", "falling": "falling"}  # short name: kind of locus
EVALUATION = with_defaults({"evaluation": {"half_width": 0.3}})["evaluation"]


@dataclass(frozen=True)
class Candidate:
    """One way in which the man or his laboratory differs.

    effect: id in the catalogue, "" for none.  size: in words.  follow: roll of the trunk per displacement of the hips [rad/m].
    hidden: effects of the simulation with their sizes.
    """

    effect: str
    size: str
    follow: float = 0.0
    hidden: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


CANDIDATES = {
    "nothing": Candidate("", "legs lean, trunk upright"),
    "rigid lean": Candidate("inertia", "trunk leans as the legs do", 1.08),
    "trunk leans more": Candidate("inertia", "three times as the legs, 17 deg at 0.1 m", 3.0),
    "trunk leans against": Candidate("inertia", "as the legs, the other way", -1.08),
    "trunk on its own": Candidate("ang_mom", "rolls by 2.9 deg at 0.65 Hz", hidden={"ang_mom": {}}),
    "CoM stretched": Candidate("com_bias", "scale +10 %", hidden={"com_bias": {"scale": 0.1}}),
    "CoM shrunk": Candidate("com_bias", "scale -10 %", hidden={"com_bias": {"scale": -0.1}}),
    "CoM shifted": Candidate("com_bias", "25 mm, as tables are off", hidden={"com_bias": {"e0": 0.025}}),
    "lean, CoM shrunk": Candidate("com_bias", "both", 1.08, {"com_bias": {"scale": -0.1}}),
    "forces late": Candidate("sync", "20 ms", hidden={"sync": {"delay": 0.02}}),
    "forces filtered": Candidate("filter", "causal, 2 Hz: 113 ms late", hidden={"filter": {"cutoff": CUTOFF}}),
    "CoM lower": Candidate("height", "knees give way, bounce of 17 mm", hidden={"height": {}}),
    "pad on the plate": Candidate("crosstalk", "40 mm", hidden={"crosstalk": {"height": 0.04}}),
}


def man() -> tuple[Subject, Controller]:
    """The paper's subject, 1.81 m and 70 kg, feet close enough for limits of 0.1 m; the gains that the paper prints for A."""
    subject = replace(draw_subject("sub-01", SEED, mass=70.0, height=1.81), stance=0.06)
    return subject, Controller(lateral=Law(4.038, 0.875, -0.1, 0.1, 0.008), forward=Controller().forward)


def table(names: Sequence[str] = tuple(CANDIDATES), runs: Sequence[int] = RUNS) -> pd.DataFrame:
    """One row per candidate: omegas as the paper would print them, of the weak form, and what the ladder says.

    Columns: candidate, effect, size; of each of KINDS: number of loci (`loci_`), median omega where the whole record was filtered, and
    where the locus was cut out first (`_cut`); weak: of the unfiltered signals, with a constant; point_mass: sqrt(g/z) [rad/s]; base,
    after, floor: held-out error of the paper's equation and with what was found, and noise [mm]; found, said: names with sizes, and what
    became of the candidate.
    """
    return pd.DataFrame([_row(name, runs) for name in names])


def _row(name: str, runs: Sequence[int]) -> dict[str, Any]:
    one = CANDIDATES[name]
    with tempfile.TemporaryDirectory() as folder:
        made = _stages(Path(folder), one, runs)
    each = pd.DataFrame(omegas(made["signals"], made["loci"])).groupby("kind")
    of: dict[str, float] = {}
    for short, kind in KINDS.items():
        mine = each.get_group(kind) if kind in each.groups else pd.DataFrame({"whole": [], "cut": []})
        of |= {f"loci_{short}": len(mine), short: float(mine["whole"].median()), f"{short}_cut": float(mine["cut"].median())}
    fit = made["fit"]
    subject = fit[(fit["level"] == "subject") & (fit["axis"] == "lateral")].iloc[0]
    return {
        "candidate": name, "effect": one.effect, "size": one.size, **of,
        "weak": float(subject["omega"]), "point_mass": float(subject["omega_height"]), **_said(made, one.effect),
    }  # fmt: skip


def _stages(folder: Path, one: Candidate, runs: Sequence[int]) -> dict[str, Any]:
    """The stages of the pipeline on his recordings, written as C3D files and read again."""
    subject, controller = man()
    touches = [draw_touches(subject, controller, run, DURATION, [SEED, 0, run]) for run in runs]
    write_study(
        folder, [subject], trials=len(runs), duration=DURATION, seed=SEED, controller=controller, touches=touches,
        habits=Habits(follow=one.follow), effects=one.hidden,
    )  # fmt: skip
    study = find(folder)
    recordings = [assemble(t) for t in study.trials]
    masses = signals.subject_masses(pd.DataFrame([{"subject": r.trial.subject, "mass": r.mass} for r in recordings]))
    made: dict[str, Any] = {}
    made["signals"], made["coverage"] = signals.of_part(recordings, study.participants, str(study.markerset), cutoff=CUTOFF, masses=masses)
    marks = [{"trial": r.trial.trial, "events": json.dumps([list(e) for e in r.events])} for r in recordings]
    made["loci"], made["pushes"] = loci.of_part(made["signals"], made["coverage"], pd.DataFrame(marks))
    made["fit"], made["heldout"] = identify(made["signals"], made["pushes"], made["loci"], made["coverage"], EVALUATION)
    return made


def omegas(table: pd.DataFrame, found: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """omega of each locus as the paper reads it [rad/s]: filtered as a whole record, and filtered after it was cut out.

    table: `signals`.  found: `loci`.
    """
    for row in rows(found):
        frames = table[(table["trial"] == row.trial) & table["frame"].between(row.start_frame, row.end_frame)]
        whole = frames["com_ddot_x"].to_numpy(), (frames["com_lp_x"] - frames["zmp_lp_x"]).to_numpy()
        time = frames["time"].to_numpy()
        x, p = (low_pass(frames[c].to_numpy(), time, CUTOFF).ravel() for c in ("com_x", "zmp_x"))
        cut = np.gradient(np.gradient(x, time), time), x - p
        yield {"kind": row.kind, "whole": _omega(*whole), "cut": _omega(*cut)}


def _omega(acceleration: Array, lever: Array) -> float:
    """Root of the slope through zero; NaN where it is negative."""
    good = np.isfinite(acceleration) & np.isfinite(lever)
    w2 = acceleration[good] @ lever[good] / (lever[good] @ lever[good])
    return float(np.sqrt(w2)) if w2 > 0 else float("nan")


def _said(made: Mapping[str, Any], effect: str) -> dict[str, Any]:
    """Errors of the ladder's first and last rung on the lateral axis [mm], the names found, and what became of the candidate."""
    effects = catalogue()
    kept, judged, tried = criticism.of_part(made["signals"], made["pushes"], made["coverage"], effects, EVALUATION)
    pooled = [t.assign(subject="all") for t in (judged, tried)]
    steps, _ = rungs.of_part(
        made["signals"], made["pushes"], made["coverage"].assign(files=""), kept, pd.concat([judged, pooled[0]]),
        pd.concat([tried, pooled[1]]), effects, [], EVALUATION,
    )  # fmt: skip
    told = ladder(made["heldout"], steps)
    told = told[(told["axis"] == "lateral") & (told["kind"] == "weak") & (told["task"] == "all") & (told["subject"] == "all")]
    told = told[told["condition"] == "all"]
    mine = tried[tried["axis"] == "lateral"].set_index("effect")
    found = mine[mine["status"] == "found"]
    names = [f"{k}: " + ", ".join(f"{n} = {v['value']:.3g}" for n, v in json.loads(r["parameters"]).items()) for k, r in found.iterrows()]
    return {
        "base": float(told["error_mm"].iloc[0]), "after": float(told["error_mm"].iloc[-1]), "floor": float(told["noise_floor_mm"].iloc[0]),
        "found": "; ".join(names), "said": str(mine.loc[effect, "status"]) if effect in mine.index else "",
    }  # fmt: skip
