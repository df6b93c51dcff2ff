"""The CoM methods of a part, side by side."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.centres import METHODS, centres

snakemake: Snakemake
stamp = job.start(snakemake)
given = snakemake.input
columns = [f"{k}_{a}" for k in (*METHODS.values(), "grf") for a in "xyz"]
signals = tables.read("signals", given.signals, columns=["trial", "subject", "task", "frame", "time", *columns])
coverage, poses = (tables.read(n, given[n]) for n in ("coverage", "poses"))
tables.write("centres", centres(signals, coverage, poses, **snakemake.params.config), snakemake.output.centres, stamp)
