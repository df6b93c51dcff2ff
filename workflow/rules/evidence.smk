# What each effect would add, window by window, and what the data of each subject lack.
rule evidence:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        trials="results/trials/{part}.parquet",
        effects=EFFECTS,
    output:
        evidence="results/evidence/{part}.parquet",
        judged="results/judged/{part}.parquet",
        candidates="results/candidates/{part}.parquet",
    log:
        "results/logs/evidence/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("evidence.py"),
        config=config["evaluation"],
    script:
        "../../scripts/evidence.py"
