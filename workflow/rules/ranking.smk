# What all subjects together lack: candidates compete on trials left out.
rule ranking:
    input:
        evidence=parts("evidence"),
        judged=parts("judged"),
        candidates=parts("candidates"),
        effects=EFFECTS,
    output:
        judged="results/judged.parquet",
        candidates="results/candidates.parquet",
    log:
        "results/logs/ranking.log",
    priority: 1
    params:
        code=code("ranking.py"),
        config=config["evaluation"],
    script:
        "../../scripts/ranking.py"
