"""Write the report."""

import json
from pathlib import Path

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.effects import catalogue
from plumbline.report import CAPTIONS, linked, page, pictures

snakemake: Snakemake
job.start(snakemake)
params, given = snakemake.params, snakemake.input
read = {
    n: tables.read_all(n, given[n]) for n in ("trials", "coverage", "loci", "pushes", "trust", "clusters", "choice", "controller", "fit")
}
read |= {n: tables.read_all(n, given[n]) for n in ("guidance", "centres", "poses", "margins")}
read["where"] = tables.read_all("where", given.where, columns=["subject", "axis", "view"])
read |= {n: tables.read(n, given[n]) for n in ("ladder", "exclusions", "candidates")}
read["residuals"] = tables.read_all("residuals", given.residuals, columns=linked.COLUMNS)
read["control"] = tables.read_all("control", given.control)
read["contributions"] = tables.read_all("contributions", given.contributions)
captions = {Path(f).stem: Path(f).read_text(encoding="utf-8") for f in sorted(CAPTIONS.glob("*.rst"))}
drawn = pictures(Path("results"), params.parts, captions, params.config)
verdict = json.loads(Path(given.verdict).read_text(encoding="utf-8"))
Path(snakemake.output[0]).write_text(page(params.study, read, verdict, params.config, drawn, catalogue(Path("."))), encoding="utf-8")
