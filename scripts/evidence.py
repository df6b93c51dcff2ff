"""Windows of a part with what each effect would add, and what the data of each of its subjects lack."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import criticism, job, tables
from plumbline.effects import catalogue

snakemake: Snakemake
stamp = job.start(snakemake)
signals, pushes, coverage = (tables.read(n, snakemake.input[n]) for n in ("signals", "pushes", "coverage"))
coverage = coverage.merge(tables.read("trials", snakemake.input.trials, columns=["trial", "files"]), on="trial")
effects = catalogue(Path("."))
for file, error in effects.broken:
    print(f"{file} cannot be used and the others go on: {error}")
made = criticism.of_part(signals, pushes, coverage, effects, snakemake.params.config)
for name, table in zip(("evidence", "judged", "candidates"), made, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
