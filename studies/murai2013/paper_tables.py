"""Make the tables of the paper from those of the pipeline."""

from murai2013 import portrait, tracks, values
from snakemake.iocontainers import Snakemake

from plumbline import job, tables

snakemake: Snakemake
job.start(snakemake)
given = {n: tables.read_all(n, snakemake.input[n]) for n in ("loci", "trust", "rls", "clusters", "controller")}
signals = tables.read_all("signals", snakemake.input.signals, columns=tracks.SIGNALS)
paper = values.published(snakemake.input.published)
groups = values.groups(given["controller"])
chosen = tracks.examples(given["loci"], given["trust"])
made = {
    "tracks": tracks.tracks(signals, given["loci"], given["clusters"]),
    "loci": given["clusters"],
    "groups": groups,
    "portrait": portrait.of_controller(groups),
    "passes": tracks.passes(chosen, given["rls"], signals),
    "switches": tracks.switches(chosen, given["trust"]),
}
for name, table in made.items():
    table.to_parquet(snakemake.output[name], index=False)
values.write(values.numbers(paper, given["controller"]), snakemake.output.numbers)
values.write(values.plausibility(paper), snakemake.output.plausibility)
