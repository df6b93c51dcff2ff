"""CoM, ZMP, forces and support of a part, one row per frame."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.recording import recordings
from plumbline.signals import of_part
from plumbline.study import Participant

snakemake: Snakemake
stamp = job.start(snakemake)
read = [tables.read(n, snakemake.input[n]) for n in ("trials", "markers", "plates")]
people = {s: Participant(**p) for s, p in snakemake.params.people.items()}
marker_set = str(snakemake.input.markerset[0]) if snakemake.input.markerset else snakemake.params.markerset
signals, coverage = of_part(recordings(*read), people, marker_set, **snakemake.params.config)
tables.write("signals", signals, snakemake.output.signals, stamp)
tables.write("coverage", coverage, snakemake.output.coverage, stamp)
