# Error of each model of the ladder on trials left out, free run, contribution of each effect.
rule rungs:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        trials="results/trials/{part}.parquet",
        evidence="results/evidence/{part}.parquet",
        judged="results/judged.parquet",
        candidates="results/candidates.parquet",
        effects=EFFECTS,
    output:
        rungs="results/rungs/{part}.parquet",
        contributions="results/contributions/{part}.parquet",
    log:
        "results/logs/rungs/{part}.log",
    priority: 1
    params:
        code=code("rungs.py"),
        config=config["evaluation"],
        models=config["models"],
    script:
        "../../scripts/rungs.py"
