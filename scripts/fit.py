"""Identify the base model of a part and judge it on trials left out."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.fit import identify
from plumbline.plant import SIGNALS

snakemake: Snakemake
stamp = job.start(snakemake)
signals = tables.read("signals", snakemake.input.signals, columns=SIGNALS)
others = [tables.read(n, snakemake.input[n]) for n in ("pushes", "loci", "coverage")]
fit, heldout = identify(signals, *others, snakemake.params.config)
tables.write("fit", fit, snakemake.output.fit, stamp)
tables.write("heldout", heldout, snakemake.output.heldout, stamp)
