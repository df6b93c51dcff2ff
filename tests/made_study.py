"""A study from its files to its held-out errors, in memory."""

import json
from pathlib import Path

import pandas as pd

from plumbline import loci as loci_stage
from plumbline import signals as signals_stage
from plumbline.config import with_defaults
from plumbline.fit import identify
from plumbline.recording import assemble
from plumbline.study import find

EVALUATION = with_defaults({})["evaluation"]


class Result:
    """What a study comes to: tables of the stages, in memory."""

    def __init__(self, folder: Path) -> None:
        study = find(folder)
        recordings = [assemble(t) for t in study.trials]
        self.axes = {r.axes for r in recordings}
        masses = signals_stage.subject_masses(
            pd.DataFrame({"subject": [r.trial.subject for r in recordings], "mass": [r.mass for r in recordings]})
        )
        options = {"cutoff": 2.0, "masses": masses}
        signals, coverage = signals_stage.of_part(recordings, study.participants, str(study.markerset), **options)
        events = [{"trial": r.trial.trial, "events": json.dumps([list(e) for e in r.events])} for r in recordings]
        self.loci, pushes = loci_stage.of_part(signals, coverage, pd.DataFrame(events))
        self.signals, self.coverage = signals, coverage
        self.pushes = pushes
        self.fit, self.heldout = identify(signals, pushes, self.loci, coverage, EVALUATION)
