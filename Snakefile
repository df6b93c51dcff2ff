# plumbline: from raw recordings of balance to an identified, criticised model.
# A study is a folder with raw/ and, if wanted, config.yaml; run it with `snakemake -s Snakefile -d STUDY -c2`.
from snakemake.utils import min_version

min_version("9.0")


include: "workflow/rules/common.smk"
include: "workflow/rules/recording.smk"
include: "workflow/rules/sesc.smk"
include: "workflow/rules/signals.smk"
include: "workflow/rules/loci.smk"
include: "workflow/rules/trust.smk"
include: "workflow/rules/clusters.smk"
include: "workflow/rules/fit.smk"
include: "workflow/rules/residuals.smk"
include: "workflow/rules/centres.smk"
include: "workflow/rules/stability.smk"
include: "workflow/rules/evidence.smk"
include: "workflow/rules/ranking.smk"
include: "workflow/rules/rungs.smk"
include: "workflow/rules/control.smk"
include: "workflow/rules/ladder.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"


PAPER = []  # what a study's own rules add
if Path("paper.smk").is_file():

    include: Path.cwd() / "paper.smk"


rule all:
    default_target: True
    input:
        "results/report.html",
        "results/verdict.json",
        "results/ladder.parquet",
        "results/exclusions.parquet",
        PAPER,
        rules.csv_tables.output if config["csv"] else [],
