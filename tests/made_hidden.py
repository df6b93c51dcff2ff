"""A simulated study with something hidden, in memory: windows, their library, and the residual that the hidden term truly leaves."""

import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from made_study import EVALUATION

from plumbline.effects import catalogue
from plumbline.effects._channels import of_trial
from plumbline.evidence import Weak, of_one
from plumbline.library import Library, library
from plumbline.physics import G
from plumbline.plant import of_trials
from plumbline.simulate.cohort import draw

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from benchmarks._study import Stages  # beside the library, not in it

LABORATORY = {"people": 1, "trials": 6, "duration": 10.0, "rate": 100.0, "force_rate": 1000.0, "marker_noise": 5e-4, "force_noise": 1.0}


@dataclass
class Hidden:
    """Windows of the lateral axis, the library, w2 of the base model, and the true residual by equation, of each trial."""

    windows: list[Weak]
    terms: Library
    w2: float
    truth: dict[str, list[np.ndarray]]


def study(name: str, seed: int, *, share: float = 0.7, **laboratory: Any) -> Hidden:
    """A study that hides one term, "" for none, at a share of its largest size."""
    kind = "outside" if name else "clean"
    case = draw(seed, kind, names=(name,) if name else (), share=(share, share), **LABORATORY | laboratory)
    trials = case.simulate()
    stages = Stages(SimpleNamespace(simulate=lambda: trials, subjects=case.subjects, rate=case.rate))  # type: ignore[arg-type]
    stages._signals()
    stages._loci()
    t = stages.tables
    plants = {k: e for k, e in catalogue().items() if e.ledger == "plant" and e.columns is not None and not e.twin}
    windows, pairs, truth = [], [], {"kinematic": [], "moment": []}
    options = {k: EVALUATION[k] for k in ("half_width", "exponent")}
    lived = {f"{one.subject.participant_id}_task-lateral_run-{one.run:02d}": one for one in trials}
    for about, frames, found in of_trials(t["signals"], t["pushes"], t["coverage"], axes=("lateral",), **options):
        plant, one = found["lateral"], lived[about["trial"]]
        channels = of_trial(frames, "lateral", float(about["mass"]))
        windows.append(of_one(about, channels, "lateral", plant, plants))
        pairs.append((channels, plant))
        n = len(plant.x)
        truth["kinematic"].append(plant.bump.mean(one.truth["outside_x"][:n] / one.subject.mass)[plant.picked])
        truth["moment"].append(plant.bump.mean(one.truth["zmp_x"][:n] - channels.zmp_x)[plant.picked])
    return Hidden(windows, library(pairs), G / float(np.mean([w.height for w in windows])), truth)
