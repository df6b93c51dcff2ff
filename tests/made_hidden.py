"""A simulated study with something hidden, in memory: windows, their library, and the residual that the hidden term truly leaves."""

import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from made_study import EVALUATION

from plumbline.effects import catalogue
from plumbline.evidence import Weak, of_part
from plumbline.library import Library, channels, library
from plumbline.physics import G
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
    windows = list(of_part(t["signals"], t["pushes"], t["coverage"], effects := catalogue(), EVALUATION, axis="lateral"))
    truth = {"kinematic": [], "moment": []}
    lived = {f"{one.subject.participant_id}_task-lateral_run-{one.run:02d}": one for one in trials}
    pairs = list(channels(windows, t["signals"], t["coverage"], effects))
    for c, w in pairs:
        one, n = lived[w.trial], len(c.time)
        truth["kinematic"].append(w.bump.mean(one.truth["outside_x"][:n] / one.subject.mass)[w.frame])
        truth["moment"].append(w.bump.mean(one.truth["zmp_x"][:n] - c.zmp_x)[w.frame])
    return Hidden(windows, library(pairs), G / float(np.mean([w.height for w in windows])), truth)
