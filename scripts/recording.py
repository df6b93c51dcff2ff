"""Read the recordings of a part."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.recording import each
from plumbline.rows import table
from plumbline.study import Trial

snakemake: Snakemake
stamp = job.start(snakemake)
params = snakemake.params
trials = [Trial.of(t) for t in params.trials]
out, rows = snakemake.output, []
with tables.Writer("markers", out.markers, stamp) as markers, tables.Writer("plates", out.plates, stamp) as plates:
    for row, of_markers, of_plates in each(trials, raw=Path(params.raw), columns=params.columns, axes=params.axes, **params.config):
        rows.append(row)
        markers.append(of_markers)
        plates.append(of_plates)
tables.write("trials", table("trials", rows), out.trials, stamp)
