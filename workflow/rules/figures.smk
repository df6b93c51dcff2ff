# Figures: one job per part draws those of its tables, one draws those of the cohort. `_` keeps them out of the tables' folders.
rule figures:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        fit="results/fit/{part}.parquet",
        residuals="results/residuals/{part}.parquet",
    output:
        signals=report(
            "results/signals/_{part}.svg",
            caption="../report/signals.rst",
            category="Recordings",
            labels={"figure": "From the recording to the CoM", "part": "{part}"},
        ),
        loci=report(
            "results/loci/_{part}.svg",
            caption="../report/loci.rst",
            category="Recordings",
            labels={"figure": "Phase portrait of all loci", "part": "{part}"},
        ),
        fit=report(
            "results/fit/_{part}.svg",
            caption="../report/fit.rst",
            category="Model",
            labels={"figure": "Natural frequency", "part": "{part}"},
        ),
        residuals=report(
            "results/residuals/_{part}.svg",
            caption="../report/residuals.rst",
            category="Model",
            labels={"figure": "Measured and modelled", "part": "{part}"},
        ),
    log:
        "results/logs/figures/{part}.log",
    params:
        code=code("figures.py"),
        config={},
    script:
        "../../scripts/figures.py"


rule maps:
    input:
        where=parts("where"),
        ladder="results/ladder.parquet",
    output:
        where=report(
            "results/where/_all.svg",
            caption="../report/where.rst",
            category="Criticism",
            labels={"figure": "Where the model fails", "part": "all"},
        ),
        ladder=report(
            "results/ladder.svg",
            caption="../report/ladder.rst",
            category="Criticism",
            labels={"figure": "The ladder", "part": "all"},
        ),
    log:
        "results/logs/maps.log",
    params:
        code=code("maps.py"),
        config={},
    script:
        "../../scripts/maps.py"
