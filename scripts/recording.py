"""Read the recordings of a part."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.recording import tables_of
from plumbline.study import Trial

snakemake: Snakemake
stamp = job.start(snakemake)
params = snakemake.params
trials = [Trial.of(t) for t in params.trials]
made = tables_of(trials, raw=Path(params.raw), columns=params.columns, axes=params.axes, **params.config)
for name, table in zip(("trials", "markers", "plates"), made, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
