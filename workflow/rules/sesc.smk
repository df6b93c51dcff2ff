# Still poses -> each subject's own CoM, its bands, what to record next.
rule sesc:
    input:
        trials="results/trials/{part}.parquet",
        markers="results/markers/{part}.parquet",
        plates="results/plates/{part}.parquet",
        markerset=[STUDY.markerset] if STUDY.markerset and config["markerset"] == "auto" else [],
    output:
        sesc="results/sesc/{part}.parquet",
        chain="results/chain/{part}.parquet",
        poses="results/poses/{part}.parquet",
        guidance="results/guidance/{part}.parquet",
    log:
        "results/logs/sesc/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("sesc.py"),
        config={**config["sesc"], "left_out": config["evaluation"]["test"]},
        markerset=config["markerset"],
        people=lambda w: {s: vars(p) for s, p in STUDY.participants.items() if PART_OF.get(s) == w.part},
    script:
        "../../scripts/sesc.py"
