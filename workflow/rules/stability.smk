# Extrapolated CoM, margins of stability and missing steps, with the subject's own omega.
rule stability:
    input:
        signals="results/signals/{part}.parquet",
    output:
        stability="results/stability/{part}.parquet",
        margins="results/margins/{part}.parquet",
    log:
        "results/logs/stability/{part}.log",
    params:
        code=code("stability.py"),
        config={},
    script:
        "../../scripts/stability.py"
