"""`plumbline check`: what in a study is usable and why the rest is not, in seconds, without writing anything."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from plumbline import markerset
from plumbline.config import models, study_config
from plumbline.effects import catalogue
from plumbline.recording import tables_of
from plumbline.study import Study, check_comparison, find


class Line(NamedTuple):
    """A line to print; whether it names something usable; its colour."""

    text: str
    usable: bool = False
    colour: str | None = None


def lines(folder: Path) -> Iterator[Line]:
    """Read every trial as the pipeline would, one at a time, and say what came of it.

    folder: the study.  Raises PlumblineError for a broken config or side table.
    """
    config = study_config(folder)
    study = find(folder, config["raw"])
    models(config, catalogue(folder))
    check_comparison(study.trials, config["evaluation"]["train"], config["evaluation"]["test"])
    read = 0
    for trial in study.trials:
        trials, markers, _ = tables_of(
            [trial], raw=study.raw, columns=config["columns"], axes=config["axes"], **config["recording"]
        )  # fmt: skip
        row = trials.iloc[0]
        read += row["reason"] == ""
        yield _line(row, markers, study, config["markerset"])
    for e in study.exclusions:
        yield Line(f"no   {e.file}: {e.reason}: {e.message}; {e.hint}", colour="yellow")
    people = sorted({t.subject for t in study.trials} - set(study.participants))
    if people:
        yield Line(f"note participants.tsv has no row for {', '.join(people)}: body mass comes from the plates, sex is unknown")
    yield Line(f"{read} of {len(study.trials)} trials can be read, {len(study.exclusions)} files belong to none")


def _line(row: pd.Series, markers: pd.DataFrame, study: Study, chosen: str) -> Line:
    if row["reason"]:
        return Line(f"no   {row['trial']}: {row['reason']}: {row['message']}; {row['hint']}", colour="red")
    text = f"yes  {row['trial']}: {row['duration']:.1f} s at {row['rate']:g} Hz, {row['markers']} markers, {row['plates']} plates"
    text += f", axes {row['axes']} ({row['axes_from']})"
    text += "; " + markerset.describe(set(markers["marker"].unique()), study.markerset, chosen)
    notes = json.loads(row["notes"]) if row["notes"] else []
    return Line("\n".join([text, *(f"       {note}" for note in notes)]), True)
