# Loci clustered by omega; batch least squares, gains, limits and their intervals for each cluster.
rule clusters:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        trust="results/trust/{part}.parquet",
    output:
        clusters="results/clusters/{part}.parquet",
        choice="results/choice/{part}.parquet",
        controller="results/controller/{part}.parquet",
    log:
        "results/logs/clusters/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("clusters.py"),
        config=WEAK,
    script:
        "../../scripts/clusters.py"
