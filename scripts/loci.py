"""Find pushes and loci of a part."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.loci import of_part

snakemake: Snakemake
stamp = job.start(snakemake)
found, pushes = of_part(*(tables.read(n, snakemake.input[n]) for n in ("signals", "coverage", "trials")))
tables.write("loci", found, snakemake.output.loci, stamp)
tables.write("pushes", pushes, snakemake.output.pushes, stamp)
