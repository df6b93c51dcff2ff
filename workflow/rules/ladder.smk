# Held-out error of each model, and the verdict other programs read.
rule ladder:
    input:
        heldout=parts("heldout"),
        rungs=parts("rungs"),
        control=parts("control"),
        coverage=parts("coverage"),
        judged="results/judged.parquet",
        candidates="results/candidates.parquet",
        effects=EFFECTS,
    output:
        ladder="results/ladder.parquet",
        verdict="results/verdict.json",
    log:
        "results/logs/ladder.log",
    params:
        code=code("ladder.py"),
        config=config["evaluation"],
        models=config["models"],
    script:
        "../../scripts/ladder.py"
