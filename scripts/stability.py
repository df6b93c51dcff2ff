"""Extrapolated CoM and margins of stability of a part."""

from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.stability import BORDERS, KEY, METHODS, stability

snakemake: Snakemake
stamp = job.start(snakemake)
columns = [
    *KEY,
    "frame",
    "time",
    "zmp_z",
    *(f"{k}_{a}" for k in METHODS.values() for a in "xyz"),
    *(b for two in BORDERS.values() for b in two),
]
signals = tables.read("signals", snakemake.input.signals, columns=columns)
for name, table in stability(signals).items():
    tables.write(name, table, snakemake.output[name], stamp)
