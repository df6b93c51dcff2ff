"""Cluster the loci of a part by omega and identify the controller of each cluster."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.clusters import of_part
from plumbline.plant import SIGNALS

snakemake: Snakemake
stamp = job.start(snakemake)
signals = tables.read("signals", snakemake.input.signals, columns=SIGNALS)
pushes, loci, coverage, trust = (tables.read(n, snakemake.input[n]) for n in ("pushes", "loci", "coverage", "trust"))
found = of_part(signals, pushes, loci, coverage, trust, snakemake.params.config)
for name, table in zip(("clusters", "choice", "controller"), found, strict=True):
    tables.write(name, table, snakemake.output[name], stamp)
