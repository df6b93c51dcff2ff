"""Simulate the paper's subject with one candidate at a time, and draw what its method makes of each."""

import pandas as pd
from murai2013 import candidates, values
from murai2013.figures import candidates as sheet
from snakemake.iocontainers import Snakemake

from plumbline import job
from plumbline.figures import _style

snakemake: Snakemake
job.start(snakemake)
made: pd.DataFrame = candidates.table()
values.write(made, snakemake.output.table)
_style.save(sheet.draw(made, values.published(snakemake.input.published)), snakemake.output.figure)
