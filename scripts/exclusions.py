"""List every file that could not be used."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.exclusions import exclusions
from plumbline.study import Exclusion

snakemake: Snakemake
stamp = job.start(snakemake)
unused = [Exclusion(*row) for row in snakemake.params.unused]
table = exclusions(tables.read_all("trials", snakemake.input), unused)
tables.write("exclusions", table, snakemake.output[0], stamp)
