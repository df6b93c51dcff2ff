"""Draw one figure of a part."""

from importlib import import_module

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.figures import _style

snakemake: Snakemake
job.start(snakemake)
draw = import_module(f"plumbline.figures.{snakemake.params.figure}").draw
_style.save(draw(**{name: tables.read(name, path) for name, path in snakemake.input.items()}), snakemake.output[0])
