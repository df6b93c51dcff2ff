"""What the law of the controller lacks, by output error; instruments and plant are settled first."""

from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import control, job, tables
from plumbline.criticism import known
from plumbline.effects import catalogue

snakemake: Snakemake
stamp = job.start(snakemake)
read = {n: tables.read(n, snakemake.input[n]) for n in ("signals", "pushes", "loci", "coverage", "trust", "clusters", "controller")}
effects = catalogue(Path("."))
judged, tried = (tables.read(n, snakemake.input[n]) for n in ("judged", "candidates"))
faults, forces, contacts = known(judged, tried, effects)
made = control.of_part(
    **read,
    evaluation=snakemake.params.config,
    corrected=faults,
    plant=forces,
    contacts=contacts,
    effects=effects,
    model=snakemake.params.model,
)
tables.write("control", made, snakemake.output.control, stamp)
