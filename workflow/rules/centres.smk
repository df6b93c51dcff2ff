# CoM methods side by side: Newton in motion, the gravity line at rest.
rule centres:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        poses="results/poses/{part}.parquet",
    output:
        centres="results/centres/{part}.parquet",
    log:
        "results/logs/centres/{part}.log",
    params:
        code=code("centres.py"),
        config={**WEAK, "tasks": config["sesc"]["tasks"]},
    script:
        "../../scripts/centres.py"
