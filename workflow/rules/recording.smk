# Files -> trials, markers, plates: SI units, axes x right, y forward, z up, reaction forces, flagged gaps.
rule recording:
    input:
        lambda w: [f for t in trials(w.part) for f in (*t.files, *([t.events] if t.events else []))],
    output:
        trials="results/trials/{part}.parquet",
        markers="results/markers/{part}.parquet",
        plates="results/plates/{part}.parquet",
    log:
        "results/logs/recording/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("recording.py"),
        config=config["recording"],
        trials=lambda w: [t.plain() for t in trials(w.part)],
        raw=str(STUDY.raw),
        axes=config["axes"],
        columns=config["columns"],
    script:
        "../../scripts/recording.py"


# Files that could not be used, one row each.
rule exclusions:
    input:
        parts("trials"),
    output:
        "results/exclusions.parquet",
    log:
        "results/logs/exclusions.log",
    params:
        code=code("exclusions.py"),
        config={},
        unused=[list(vars(e).values()) for e in STUDY.exclusions],
    script:
        "../../scripts/exclusions.py"
