"""Compare what was identified with the paper and with the truth, which nothing else opens."""

import json
from pathlib import Path

from murai2013 import values
from murai2013.figures import comparison
from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.figures import _style

snakemake: Snakemake
job.start(snakemake)
truth = json.loads(Path(snakemake.input.truth).read_text(encoding="utf-8"))
table = values.with_truth(values.read(snakemake.input.numbers), truth)
values.write(table, snakemake.output.table)
values.write(values.switching(tables.read_all("trust", snakemake.input.trust), truth), snakemake.output.switching)
_style.save(comparison.draw(table), snakemake.output.figure)
