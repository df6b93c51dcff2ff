"""Draw the figures of the cohort."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.figures import _style, ladder, where

snakemake: Snakemake
job.start(snakemake)
_style.save(where.draw(tables.read_all("where", snakemake.input.where)), snakemake.output.where)
_style.save(ladder.draw(tables.read("ladder", snakemake.input.ladder)), snakemake.output.ladder)
