"""Find the regimes of each locus of a part and the switches between them."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.trust import COLUMNS, of_part

snakemake: Snakemake
stamp = job.start(snakemake)
signals = tables.read("signals", snakemake.input.signals, columns=COLUMNS)
pushes, loci, coverage, trials = (tables.read(n, snakemake.input[n]) for n in ("pushes", "loci", "coverage", "trials"))
trust, rls = of_part(signals, pushes, loci, coverage, trials, snakemake.params.config)
tables.write("trust", trust, snakemake.output.trust, stamp)
tables.write("rls", rls, snakemake.output.rls, stamp)
