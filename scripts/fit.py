"""Identify the base model of a part and judge it on trials left out."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.fit import identify
from plumbline.plant import SIGNALS

snakemake: Snakemake
stamp = job.start(snakemake)
signals = tables.read("signals", snakemake.input.signals, columns=SIGNALS)
pushes, loci, coverage = (tables.read(n, snakemake.input[n]) for n in ("pushes", "loci", "coverage"))
coverage = coverage.merge(tables.read("trials", snakemake.input.trials, columns=["trial", "files"]), on="trial")
fit, heldout = identify(signals, pushes, loci, coverage, snakemake.params.config)
tables.write("fit", fit, snakemake.output.fit, stamp)
tables.write("heldout", heldout, snakemake.output.heldout, stamp)
