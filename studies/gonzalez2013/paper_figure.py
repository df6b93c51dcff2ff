"""Draw one figure from the tables of the study."""

from importlib import import_module
from pathlib import Path

import pandas as pd
from gonzalez2013.figures import FIGURES
from snakemake.iocontainers import Snakemake

from plumbline import job
from plumbline.figures import _style

snakemake: Snakemake
job.start(snakemake)
draw = import_module(f"gonzalez2013.figures.{FIGURES[snakemake.wildcards.figure].module}").draw
_style.save(draw(**{Path(f).stem: pd.read_parquet(f) for f in snakemake.input}), snakemake.output[0])
