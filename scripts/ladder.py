"""Held-out error of each model over all parts, and the verdict."""

import json
from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import config, job, tables
from plumbline.effects import catalogue
from plumbline.ladder import Said, ladder, unsettled, verdict

snakemake: Snakemake
stamp = job.start(snakemake)
effects = catalogue(Path("."))
heldout, rungs, control, coverage = (tables.read_all(n, snakemake.input[n]) for n in ("heldout", "rungs", "control", "coverage"))
judged, tried = (tables.read(n, snakemake.input[n]) for n in ("judged", "candidates"))
table = ladder(heldout, rungs, control, effects, unsettled(judged))
tables.write("ladder", table, snakemake.output.ladder, stamp)
models = config.models({"models": snakemake.params.models}, effects)
said = verdict(Said(table, coverage, heldout, judged, tried, control), snakemake.params.config, effects, models)
Path(snakemake.output.verdict).write_text(json.dumps(said, indent=1, allow_nan=False) + "\n", encoding="utf-8")
