"""Forty simulated people: the paper's estimators and ours, and what each protocol can tell."""

from gonzalez2013 import cohort, people, values
from snakemake.iocontainers import Snakemake

from plumbline import job
from plumbline.simulate import nine_segments as nine

snakemake: Snakemake
job.start(snakemake)
out = snakemake.output
plan, everybody = people.protocol(rate=50.0), nine.cohort(cohort.PEOPLE)
rows, flags, holds = cohort.measure(plan, everybody), cohort.observed(plan, everybody), cohort.designed(plan)
many = cohort.covered(plan)
times = cohort.timed(people.protocol(rate=100.0), everybody)
rows.to_parquet(out.people, index=False)
many.to_parquet(out.many, index=False)
flags.to_parquet(out.flags, index=False)
holds.to_parquet(out.holds, index=False)
values.write(cohort.summary(rows, many, flags, holds, times), out.summary)
