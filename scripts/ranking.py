"""What all subjects together lack."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import criticism, job, tables
from plumbline.effects import catalogue

snakemake: Snakemake
stamp = job.start(snakemake)
alone, tried = (tables.read_all(n, snakemake.input[n]) for n in ("judged", "candidates"))
evidence = criticism.Shelf(snakemake.input.evidence)
made = criticism.of_cohort(evidence, alone, tried, catalogue(Path(".")))
for name, table in zip(("judged", "candidates"), made, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
