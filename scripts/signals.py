"""CoM, ZMP, forces and support of a part, one row per frame."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.recording import recordings
from plumbline.signals import of_part, own_com, subject_masses
from plumbline.study import Participant

snakemake: Snakemake
stamp = job.start(snakemake)
inputs, trials = snakemake.input, tables.read("trials", snakemake.input.trials)
people = {s: Participant(**p) for s, p in snakemake.params.people.items()}
marker_set = str(inputs.markerset[0]) if inputs.markerset else snakemake.params.markerset
found = recordings(trials, lambda name, trial: tables.read(name, inputs[name], trial=trial))
own = own_com(lambda trial: tables.read("sesc", inputs.sesc, trial=trial))
signals, coverage = of_part(found, people, marker_set, masses=subject_masses(trials), own=own, **snakemake.params.config)
tables.write("signals", signals, snakemake.output.signals, stamp)
tables.write("coverage", coverage, snakemake.output.coverage, stamp)
