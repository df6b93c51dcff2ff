"""A simulated study through the stages of the pipeline, in memory: the tables that a run of the files would leave."""

import json
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from plumbline import clusters, loci, signals, trust
from plumbline.config import with_defaults
from plumbline.fit import identify
from plumbline.ladder import ladder
from plumbline.readers.raw import Raw, RawPlate
from plumbline.recording import Recording, assemble
from plumbline.simulate.cohort import Case
from plumbline.simulate.human import SimulatedTrial
from plumbline.simulate.study import events, marker_set
from plumbline.study import Participant, Trial

Tables = dict[str, pd.DataFrame]


def raw_of(trial: SimulatedTrial, rate: float) -> Raw:
    """What the reader of a C3D file finds: forces that act on the plates; numbers in single precision, as the file holds them."""
    labels = list(trial.markers)
    points = np.stack([_single(trial.markers[label] * 1e3) / 1e3 for label in labels], axis=1)
    plates = [RawPlate(p.time, _single(-p.force), _single(-p.moment * 1e3) / 1e3, p.centre, p.corners, "type-2") for p in trial.plates]
    return Raw(trial.time, rate, points, labels, plates=plates)


def _single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32).astype(np.float64)


def recordings(trials: Iterable[SimulatedTrial], rate: float) -> Iterator[Recording]:
    """Each trial as the stage `recording` hands it on, with the pushes that its events file would name."""
    for one in trials:
        subject = one.subject.participant_id
        name = f"{subject}_task-lateral_run-{one.run:02d}"
        raw = raw_of(one, rate)
        made = assemble(Trial(name, subject, "", "lateral", "", f"{one.run:02d}", (Path(f"{name}.c3d"),)), read=lambda *_, raw=raw: raw)
        rows = [line.split("\t") for line in events(one).splitlines()[1:]]
        made.events = [(float(onset), float(duration), kind) for onset, duration, kind in rows]
        yield made


@dataclass
class Stages:
    """The stages of one study, one after the other; `tables` holds what they left, `spent` the processor time of each [s]."""

    case: Case
    tables: Tables = field(default_factory=dict)
    spent: dict[str, float] = field(default_factory=dict)
    config: Mapping[str, Any] = field(default_factory=lambda: with_defaults({}))

    def plant(self) -> Tables:
        """Tables trials, signals, coverage, loci, pushes, fit, heldout."""
        self._clocked("simulate", self._signals)
        self._clocked("loci", self._loci)
        self._clocked("fit", self._fit)
        return self.tables

    def base_error(self) -> tuple[float, float]:
        """Held-out error of the paper's equation in the lateral direction and its noise floor [mm]; NaN where it could not be judged."""
        table = ladder(self.plant()["heldout"])
        key = {"axis": "lateral", "kind": "weak", "task": "all", "subject": "all", "condition": "all"}
        row = table[(table[list(key)] == pd.Series(key)).all(axis=1)].iloc[0]
        return float(row["error_mm"]), float(row["noise_floor_mm"])

    def control(self) -> Tables:
        """Tables trust, rls, clusters, choice, controller beside those of the plant."""
        weak = {k: self.config["evaluation"][k] for k in ("half_width", "exponent")}
        t = self.tables

        def regimes() -> None:
            t["trust"], t["rls"] = trust.of_part(t["signals"], t["pushes"], t["loci"], t["coverage"], t["trials"], weak)

        def laws() -> None:
            found = clusters.of_part(t["signals"], t["pushes"], t["loci"], t["coverage"], t["trust"], weak)
            t.update(zip(("clusters", "choice", "controller"), found, strict=True))

        self._clocked("trust", regimes)
        self._clocked("clusters", laws)
        return t

    def _clocked(self, name: str, stage: Any) -> None:
        start = time.process_time()
        stage()
        self.spent[name] = round(time.process_time() - start, 2)

    def _signals(self) -> None:
        case = self.case
        people = {s.participant_id: Participant(s.participant_id, s.mass, s.height, s.sex) for s in case.subjects}
        start = time.process_time()
        trials = case.simulate()
        self.spent["motion"] = round(time.process_time() - start, 2)
        found = list(recordings(trials, case.rate))
        rows = [
            {"trial": r.trial.trial, "subject": r.trial.subject, "task": r.trial.task, "condition": "", "files": f"{r.trial.trial}.c3d",
             "events": json.dumps([list(e) for e in r.events]), "mass": r.mass, "reason": ""}
            for r in found
        ]  # fmt: skip
        self.tables["trials"] = pd.DataFrame(rows)
        with tempfile.TemporaryDirectory() as folder:
            numbers = Path(folder) / "markerset.yaml"
            numbers.write_text(marker_set(case.subjects), encoding="utf-8")
            masses = signals.subject_masses(self.tables["trials"])
            made = signals.of_part(found, people, str(numbers), masses=masses, **self.config["signals"])
        self.tables.update(zip(("signals", "coverage"), made, strict=True))

    def _loci(self) -> None:
        t = self.tables
        t["loci"], t["pushes"] = loci.of_part(t["signals"], t["coverage"], t["trials"])

    def _fit(self) -> None:
        t = self.tables
        coverage = t["coverage"].merge(t["trials"][["trial", "files"]], on="trial")
        t["fit"], t["heldout"] = identify(t["signals"], t["pushes"], t["loci"], coverage, self.config["evaluation"])
