# Residuals frame by frame, and their maps over phase plane, time, trial and frequency.
rule residuals:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        heldout="results/heldout/{part}.parquet",
    output:
        residuals="results/residuals/{part}.parquet",
        where="results/where/{part}.parquet",
    log:
        "results/logs/residuals/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("residuals.py"),
        config=config["evaluation"],
    script:
        "../../scripts/residuals.py"
