# Figures: one job per part and stage, and one for the cohort. `_` keeps them out of the tables' folders.
rule signals_figure:
    input:
        signals="results/signals/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
    output:
        report(
            "results/signals/_{part}.svg",
            caption="../report/signals.rst",
            category="Recordings",
            labels={"figure": "From the recording to the CoM", "part": "{part}"},
        ),
    log:
        "results/logs/signals_figure/{part}.log",
    params:
        code=code("figure.py", "figures/signals.py"),
        config={},
        figure="signals",
    script:
        "../../scripts/figure.py"


rule loci_figure:
    input:
        signals="results/signals/{part}.parquet",
        loci="results/loci/{part}.parquet",
        fit="results/fit/{part}.parquet",
    output:
        report(
            "results/loci/_{part}.svg",
            caption="../report/loci.rst",
            category="Recordings",
            labels={"figure": "Phase portrait of all loci", "part": "{part}"},
        ),
    log:
        "results/logs/loci_figure/{part}.log",
    params:
        code=code("figure.py", "figures/loci.py"),
        config={},
        figure="loci",
    script:
        "../../scripts/figure.py"


rule trust_figure:
    input:
        trust="results/trust/{part}.parquet",
        rls="results/rls/{part}.parquet",
        signals="results/signals/{part}.parquet",
        loci="results/loci/{part}.parquet",
        clusters="results/clusters/{part}.parquet",
        controller="results/controller/{part}.parquet",
    output:
        report(
            "results/trust/_{part}.svg",
            caption="../report/trust.rst",
            category="Controller",
            labels={"figure": "Regimes and returning RLS", "part": "{part}"},
        ),
    log:
        "results/logs/trust_figure/{part}.log",
    params:
        code=code("figure.py", "figures/trust.py"),
        config={},
        figure="trust",
    script:
        "../../scripts/figure.py"


rule clusters_figure:
    input:
        clusters="results/clusters/{part}.parquet",
        choice="results/choice/{part}.parquet",
        controller="results/controller/{part}.parquet",
    output:
        report(
            "results/clusters/_{part}.svg",
            caption="../report/clusters.rst",
            category="Controller",
            labels={"figure": "Clusters of omega and gains", "part": "{part}"},
        ),
    log:
        "results/logs/clusters_figure/{part}.log",
    params:
        code=code("figure.py", "figures/clusters.py"),
        config={},
        figure="clusters",
    script:
        "../../scripts/figure.py"


rule fit_figure:
    input:
        fit="results/fit/{part}.parquet",
    output:
        report(
            "results/fit/_{part}.svg",
            caption="../report/fit.rst",
            category="Model",
            labels={"figure": "Natural frequency", "part": "{part}"},
        ),
    log:
        "results/logs/fit_figure/{part}.log",
    params:
        code=code("figure.py", "figures/fit.py"),
        config={},
        figure="fit",
    script:
        "../../scripts/figure.py"


rule residuals_figure:
    input:
        residuals="results/residuals/{part}.parquet",
    output:
        report(
            "results/residuals/_{part}.svg",
            caption="../report/residuals.rst",
            category="Model",
            labels={"figure": "Measured and modelled", "part": "{part}"},
        ),
    log:
        "results/logs/residuals_figure/{part}.log",
    params:
        code=code("figure.py", "figures/residuals.py"),
        config={},
        figure="residuals",
    script:
        "../../scripts/figure.py"


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
