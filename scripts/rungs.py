"""Error of each model of the ladder on trials left out, and what each effect contributes."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import config, job, rungs, tables
from plumbline.effects import catalogue

snakemake: Snakemake
stamp = job.start(snakemake)
signals, pushes, coverage, evidence = (tables.read(n, snakemake.input[n]) for n in ("signals", "pushes", "coverage", "evidence"))
coverage = coverage.merge(tables.read("trials", snakemake.input.trials, columns=["trial", "files"]), on="trial")
judged, tried = (tables.read(n, snakemake.input[n]) for n in ("judged", "candidates"))
effects = catalogue(Path("."))
models = config.models({"models": snakemake.params.models}, effects)
made = rungs.of_part(signals, pushes, coverage, evidence, judged, tried, effects, models, snakemake.params.config)
for name, table in zip(("rungs", "contributions"), made, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
