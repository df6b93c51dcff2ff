"""Draw one figure of the paper from the tables of the study."""

from importlib import import_module
from pathlib import Path

import pandas as pd
from murai2013.figures import FIGURES
from snakemake.iocontainers import Snakemake

from plumbline import job
from plumbline.figures import _style

snakemake: Snakemake
job.start(snakemake)
sheet = FIGURES[snakemake.wildcards.figure]
draw = import_module(f"murai2013.figures.{sheet.module}").draw
_style.save(draw(**{Path(f).stem: pd.read_parquet(f) for f in snakemake.input}, **sheet.about), snakemake.output[0])
