# Trials -> CoM, ZMP, forces, angular momentum, support limits: one row per frame.
rule signals:
    input:
        trials="results/trials/{part}.parquet",
        markers="results/markers/{part}.parquet",
        plates="results/plates/{part}.parquet",
        sesc="results/sesc/{part}.parquet",
        markerset=[STUDY.markerset] if STUDY.markerset and config["markerset"] == "auto" else [],
    output:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
    log:
        "results/logs/signals/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("signals.py"),
        config=config["signals"],
        markerset=config["markerset"],
        people=lambda w: {s: vars(p) for s, p in STUDY.participants.items() if PART_OF.get(s) == w.part},
    script:
        "../../scripts/signals.py"
