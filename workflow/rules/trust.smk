# Loci -> regimes of the controller (ZMP at a limit or inside), switching points by change point and by returning RLS.
rule trust:
    input:
        signals="results/signals/{part}.parquet",
        coverage="results/coverage/{part}.parquet",
        pushes="results/pushes/{part}.parquet",
        loci="results/loci/{part}.parquet",
        trials="results/trials/{part}.parquet",
    output:
        trust="results/trust/{part}.parquet",
        rls="results/rls/{part}.parquet",
    log:
        "results/logs/trust/{part}.log",
    priority: 1  # the chain of stages before the figures beside it
    params:
        code=code("trust.py"),
        config=WEAK,
    script:
        "../../scripts/trust.py"
