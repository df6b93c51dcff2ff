"""Held-out error of each model over all parts, and the verdict."""

import json
from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.ladder import ladder, verdict

snakemake: Snakemake
stamp = job.start(snakemake)
heldout = tables.read_all("heldout", snakemake.input.heldout)
table = ladder(heldout)
tables.write("ladder", table, snakemake.output.ladder, stamp)
said = verdict(table, snakemake.params.config, tables.read_all("coverage", snakemake.input.coverage), heldout)
Path(snakemake.output.verdict).write_text(json.dumps(said, indent=1, allow_nan=False) + "\n", encoding="utf-8")
