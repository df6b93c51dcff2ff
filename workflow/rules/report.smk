# One self-contained page: verdict, what was read and what was not, figures, linked views, methods.
rule report:
    input:
        verdict="results/verdict.json",
        ladder="results/ladder.parquet",
        exclusions="results/exclusions.parquet",
        trials=parts("trials"),
        coverage=parts("coverage"),
        loci=parts("loci"),
        pushes=parts("pushes"),
        guidance=parts("guidance"),
        centres=parts("centres"),
        poses=parts("poses"),
        margins=parts("margins"),
        trust=parts("trust"),
        clusters=parts("clusters"),
        choice=parts("choice"),
        controller=parts("controller"),
        fit=parts("fit"),
        where=parts("where"),
        residuals=parts("residuals")[:1],
        contributions=parts("contributions")[:1],
        candidates="results/candidates.parquet",
        control=parts("control"),
        effects=EFFECTS,
        figures=expand(
            "results/{stage}/_{part}.svg",
            stage=["signals", "loci", "trust", "clusters", "fit", "residuals"],
            part=PARTS,
        ),
        maps=["results/where/_all.svg", "results/ladder.svg"],
    output:
        report(
            "results/report.html",
            caption="../report/report.rst",
            category="Report",
            labels={"figure": "The report as one page", "part": "all"},
        ),
    log:
        "results/logs/report.log",
    params:
        code=code("report.py"),
        config={k: config[k] for k in ("recording", "signals", "sesc", "evaluation", "models")},
        study="demo study" if Path.cwd() == REPO else Path.cwd().name,
        parts=PARTS,
    script:
        "../../scripts/report.py"


# Every table as text, where the config asks for it.
rule csv_tables:
    input:
        **{t: parts(t) for t in PART_TABLES},
        ladder="results/ladder.parquet",
        exclusions="results/exclusions.parquet",
    output:
        expand("results/csv/{table}.csv", table=[*PART_TABLES, "ladder", "exclusions"]),
    log:
        "results/logs/csv_tables.log",
    params:
        code=code("csv_tables.py"),
        config={},
    script:
        "../../scripts/csv_tables.py"
