# The paper's figures and Table I, after the pipeline's own stages, and forty people. `PAPER` is what `all` asks for beside the report.
sys.path.insert(0, str(Path.cwd()))

from gonzalez2013.figures import FIGURES

PAPER = [*expand("results/paper/{figure}.svg", figure=FIGURES), "results/paper/table1.tsv", "results/paper/cohort.tsv"]
PAPER_CODE = digest(*sorted(Path("gonzalez2013").rglob("*.py")), *sorted(Path(".").glob("*.py")))


# The only rule that opens the truth of raw/.
rule paper_tables:
    input:
        trials=parts("trials"),
        markers=parts("markers"),
        plates=parts("plates"),
        signals=parts("signals"),
        sesc=parts("sesc"),
        markerset="markerset.yaml",
        published="published.tsv",
    output:
        tracks="results/paper/tracks.parquet",
        stability="results/paper/stability.parquet",
        table="results/paper/table1.tsv",
    log:
        "results/logs/paper_tables.log",
    params:
        code=PAPER_CODE,
        config={},
        truth="truth",
    script:
        "paper_tables.py"


# Simulates forty people of its own and judges them against their truth (about four minutes of one core).
rule cohort:
    output:
        people="results/paper/people.parquet",
        many="results/paper/many.parquet",
        flags="results/paper/flags.parquet",
        holds="results/paper/holds.parquet",
        summary="results/paper/cohort.tsv",
    log:
        "results/logs/cohort.log",
    params:
        code=PAPER_CODE,
        config={},
    script:
        "cohort.py"


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
        figure="|".join(FIGURES),
    params:
        code=PAPER_CODE,
        config={},
    script:
        "paper_figure.py"
