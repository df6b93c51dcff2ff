# Base model x'' = w2 (x - xZ): w2 per locus, condition and subject, and its error on trials left out.
rule fit:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        trials="results/trials/{part}.parquet",
    output:
        fit="results/fit/{part}.parquet",
        heldout="results/heldout/{part}.parquet",
    log:
        "results/logs/fit/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("fit.py"),
        config=config["evaluation"],
    script:
        "../../scripts/fit.py"
