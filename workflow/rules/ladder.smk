# Held-out error of each model, and the verdict other programs read.
rule ladder:
    input:
        heldout=parts("heldout"),
        coverage=parts("coverage"),
    output:
        ladder="results/ladder.parquet",
        verdict="results/verdict.json",
    log:
        "results/logs/ladder.log",
    params:
        code=code("ladder.py"),
        config=config["evaluation"],
    script:
        "../../scripts/ladder.py"
