# Signals and events -> pushes (masked everywhere) and loci, one row each.
rule loci:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        trials="results/trials/{part}.parquet",
    output:
        loci="results/loci/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
    log:
        "results/logs/loci/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("loci.py"),
        config={},
    script:
        "../../scripts/loci.py"
