# The paper's figures and numbers, after the pipeline's own stages. `PAPER` is what `all` asks for beside the report.
sys.path.insert(0, str(Path.cwd()))

from murai2013.figures import FIGURES

PAPER = [
    *expand("results/paper/{figure}.svg", figure=FIGURES),
    "results/paper/numbers.tsv",
    "results/paper/plausibility.tsv",
    "results/paper/candidates.tsv",
    *(["results/paper/comparison.svg"] if Path("truth.json").is_file() else []),
]
PAPER_CODE = digest(*sorted(Path("murai2013").rglob("*.py")), *sorted(Path(".").glob("*.py")))


rule paper_tables:
    input:
        signals=parts("signals"),
        loci=parts("loci"),
        trust=parts("trust"),
        rls=parts("rls"),
        clusters=parts("clusters"),
        controller=parts("controller"),
        published="published.tsv",
    output:
        **{t: f"results/paper/{t}.parquet" for t in ("tracks", "loci", "groups", "portrait", "passes", "switches")},
        numbers="results/paper/numbers.tsv",
        plausibility="results/paper/plausibility.tsv",
    log:
        "results/logs/paper_tables.log",
    params:
        code=PAPER_CODE,
        config={},
    script:
        "paper_tables.py"


rule paper_figure:
    input:
        lambda w: [f"results/paper/{t}.parquet" for t in FIGURES[w.figure].tables],
    output:
        report(
            "results/paper/{figure}.svg",
            caption="captions/figure.rst",
            category="The paper",
            labels={"figure": "{figure}", "part": "all"},
        ),
    log:
        "results/logs/paper_figure/{figure}.log",
    wildcard_constraints:
        figure=r"fig\d+",
    params:
        code=PAPER_CODE,
        config={},
    script:
        "paper_figure.py"


# The only rule that opens the truth.
rule comparison:
    input:
        numbers="results/paper/numbers.tsv",
        trust=parts("trust"),
        truth="truth.json",
    output:
        table="results/paper/comparison.tsv",
        switching="results/paper/switching.tsv",
        figure=report(
            "results/paper/comparison.svg",
            caption="captions/comparison.rst",
            category="The paper",
            labels={"figure": "paper, identified, truth", "part": "all"},
        ),
    log:
        "results/logs/comparison.log",
    params:
        code=PAPER_CODE,
        config={},
    script:
        "comparison.py"


# What could make the paper's omegas: a man of its subject's size, one candidate at a time (about a minute of one core).
rule candidates:
    input:
        published="published.tsv",
    output:
        table="results/paper/candidates.tsv",
        figure=report(
            "results/paper/candidates.svg",
            caption="captions/candidates.rst",
            category="The paper",
            labels={"figure": "which effects can make the omegas", "part": "all"},
        ),
    log:
        "results/logs/candidates.log",
    params:
        code=PAPER_CODE,
        config={},
    script:
        "candidates.py"
