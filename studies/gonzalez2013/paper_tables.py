"""Make the tables of the paper from those of the pipeline and the truth, which nothing else opens."""

from pathlib import Path

from gonzalez2013 import values
from snakemake.iocontainers import Snakemake

from plumbline import job, tables
from plumbline.markerset import load
from plumbline.recording import recordings

snakemake: Snakemake
job.start(snakemake)
inputs, out = snakemake.input, snakemake.output
trials = tables.read_all("trials", inputs.trials)
found = {}
for part, markers, plates in zip(inputs.trials, inputs.markers, inputs.plates, strict=True):
    files = {"markers": markers, "plates": plates}
    for r in recordings(tables.read("trials", part), lambda name, trial, files=files: tables.read(name, files[name], trial=trial)):
        found[r.trial.task] = r
given = values.scenes(found, load(Path(inputs.markerset)))
true = {task: values.truth(snakemake.params.truth, r.trial.trial, r.time) for task, r in found.items()}
signals, own = tables.read_all("signals", inputs.signals), tables.read_all("sesc", inputs.sesc)
lines = values.tracks(signals, own, true)
lines.to_parquet(out.tracks, index=False)
sts = signals[signals["task"] == "sts"]
load_of = {"feet": sts["grf_left_z"].to_numpy() + sts["grf_right_z"].to_numpy(), "all": sts["grf_z"].to_numpy()}
values.stable(signals, lines, load_of).to_parquet(out.stability, index=False)
told = values.fitted(given)
values.write(values.table_one(values.published(inputs.published), given, told, true), out.table)
