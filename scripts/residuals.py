"""Residuals of a part, frame by frame, and their maps."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.plant import SIGNALS
from plumbline.residuals import residuals

snakemake: Snakemake
stamp = job.start(snakemake)
signals = tables.read("signals", snakemake.input.signals, columns=SIGNALS)
others = [tables.read(n, snakemake.input[n]) for n in ("pushes", "loci", "coverage", "heldout")]
frames, where = residuals(signals, *others, snakemake.params.config)
tables.write("residuals", frames, snakemake.output.residuals, stamp)
tables.write("where", where, snakemake.output.where, stamp)
