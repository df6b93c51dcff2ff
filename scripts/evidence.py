"""Windows of a part with what each effect would add, and what the data of each of its subjects lack."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import criticism, job, tables
from plumbline.effects import catalogue

snakemake: Snakemake
stamp = job.start(snakemake)
signals, pushes, coverage = (tables.read(n, snakemake.input[n]) for n in ("signals", "pushes", "coverage"))
made = criticism.of_part(signals, pushes, coverage, catalogue(Path(".")), snakemake.params.config)
for name, table in zip(("evidence", "judged", "candidates"), made, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
