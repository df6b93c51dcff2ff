"""Write every table as text."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import job, tables

snakemake: Snakemake
job.start(snakemake)
for target in snakemake.output:
    given = snakemake.input[Path(target).stem]
    tables.to_csv(Path(target).stem, [given] if isinstance(given, str) else given, target)
