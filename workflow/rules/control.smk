# What the law of the controller lacks: output error of the simulated loop on trials left out.
rule control:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        trust="results/trust/{part}.parquet",
        clusters="results/clusters/{part}.parquet",
        controller="results/controller/{part}.parquet",
        judged="results/judged/{part}.parquet",
        candidates="results/candidates/{part}.parquet",
        effects=EFFECTS,
    output:
        control="results/control/{part}.parquet",
    log:
        "results/logs/control/{part}.log",
    priority: 1
    params:
        code=code("control.py"),
        config=config["evaluation"],
        model=of_the_law(config["models"]),
    script:
        "../../scripts/control.py"
