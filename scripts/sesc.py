"""Each subject's own CoM from still poses, and what they cannot tell."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.recording import recordings
from plumbline.sesc import of_part
from plumbline.signals import subject_masses
from plumbline.study import Participant

snakemake: Snakemake
stamp = job.start(snakemake)
inputs, trials = snakemake.input, tables.read("trials", snakemake.input.trials)
people = {s: Participant(**p) for s, p in snakemake.params.people.items()}
marker_set = str(inputs.markerset[0]) if inputs.markerset else snakemake.params.markerset
trials = trials.sort_values("subject", kind="stable")  # one subject after the other is in memory
found = recordings(trials, lambda name, trial: tables.read(name, inputs[name], trial=trial))
for name, table in of_part(found, people, marker_set, masses=subject_masses(trials), **snakemake.params.config).items():
    tables.write(name, table, snakemake.output[name], stamp)
