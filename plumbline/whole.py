"""The criticism of a study in memory, as a run leaves it on disk: for benchmarks and tests."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from plumbline import control, rungs
from plumbline.config import models, with_defaults
from plumbline.criticism import known, of_cohort, of_part
from plumbline.effects import Catalogue, catalogue
from plumbline.ladder import Said, ladder, unsettled, verdict

CRITICISM = ("evidence", "judged", "candidates", "control", "rungs", "ladder")


def criticised(
    tables: Mapping[str, pd.DataFrame], config: Mapping[str, Any] | None = None, effects: Catalogue | None = None
) -> dict[str, Any]:
    """What a run would leave of the criticism: CRITICISM's tables by name, and `verdict`.

    tables: trials, signals, coverage, pushes, loci, fit, heldout, trust, clusters, controller of all subjects.
    """
    config = config or with_defaults({})
    effects = effects if effects is not None else catalogue()
    evaluation, listed = config["evaluation"], models(config, effects)
    made: dict[str, Any] = {}
    coverage = tables["coverage"].merge(tables["trials"][["trial", "files"]], on="trial")
    made["evidence"], alone, tried = of_part(tables["signals"], tables["pushes"], coverage, effects, evaluation)
    of = dict(tuple(made["evidence"].groupby("subject")))
    made["judged"], made["candidates"] = of_cohort(of, alone, tried, effects)
    faults, others, contacts = known(alone, tried, effects)
    stages: dict[str, Any] = {n: tables[n] for n in ("signals", "pushes", "loci", "coverage", "trust", "clusters", "controller")}
    made["control"] = control.of_part(**stages, evaluation=evaluation, corrected=faults, plant=others, contacts=contacts, effects=effects)
    made["rungs"], _ = rungs.of_part(
        tables["signals"], tables["pushes"], coverage, made["evidence"], made["judged"], made["candidates"], effects, listed, evaluation
    )
    made["ladder"] = ladder(tables["heldout"], made["rungs"], made["control"], effects, unsettled(made["judged"]))
    said = Said(made["ladder"], tables["coverage"], tables["heldout"], made["judged"], made["candidates"], made["control"])
    made["verdict"] = verdict(said, evaluation, effects, listed)
    return made


def verdict_of_tables(tables: Mapping[str, pd.DataFrame]) -> dict[str, Any]:
    """The verdict of a study, with every candidate in the block of its ledger: effect, family, lower end of the fall it brings."""
    made = criticised(tables)
    out = dict(made["verdict"])
    rows = made["candidates"]
    rows = rows[(rows["axis"] == "lateral") & (rows["subject"] == "all")].dropna(subset=["fall_low"])
    out["plant"] = out["plant"] | {
        "candidates": [
            {"effect": r["effect"], "family": [r["effect"]], "fall_low_mm": 1e3 * float(r["fall_low"])} for _, r in rows.iterrows()
        ]
    }
    return out
