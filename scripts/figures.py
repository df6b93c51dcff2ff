"""Draw the figures of a part."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.figures import _style, fit, loci, residuals, signals

snakemake: Snakemake
job.start(snakemake)
t = {n: tables.read(n, snakemake.input[n]) for n in ("signals", "coverage", "pushes", "loci", "fit", "residuals")}
_style.save(signals.draw(t["signals"], t["pushes"], t["coverage"]), snakemake.output.signals)
_style.save(loci.draw(t["signals"], t["loci"], t["fit"]), snakemake.output.loci)
_style.save(fit.draw(t["fit"]), snakemake.output.fit)
_style.save(residuals.draw(t["residuals"]), snakemake.output.residuals)
