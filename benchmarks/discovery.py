"""Is the search for missing effects right? A cohort of simulated studies with known truth, judged one by one.

    python -m benchmarks.discovery --clean 300 --effects 300 --outside 60 --pairs 60 --jobs 2 [--seed S] [--out FOLDER]

Each study is drawn, simulated and judged; a line of JSON goes to FOLDER/seed-S.jsonl as it is done, so that a broken run goes on
where it stopped when started again with its seed. At the end: the table of rates with 95 % Wilson intervals, one row per effect,
and the power curves (power.svg, with their numbers in power.parquet). Without a seed one is drawn, and said.
"""

import argparse
import contextlib
import functools
import json
import math
import multiprocessing
import os
import secrets
import sys
import time
import traceback
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks import _score
from benchmarks.__main__ import table
from plumbline.bootstrap import ENVIRONMENT

Judge = Callable[[Mapping[str, Any]], dict[str, Any]]
Job = tuple[str, int, int]  # kind, number, seed of the cohort
LARGE = (0.45, 1.0)  # [1] sizes of effects in pairs: both should be seen
COLUMNS = 4


def plan(clean: int, effects: int, outside: int, pairs: int, seed: int) -> list[Job]:
    """Which studies to make, kinds mixed evenly so that an unfinished run already tells something of each."""
    counts = {"clean": clean, "one": effects, "outside": outside, "two": pairs}
    jobs = [((i + 0.5) / n, kind, i) for kind, n in counts.items() for i in range(n)]
    return [(kind, i, seed) for _, kind, i in sorted(jobs)]


def case_of(job: Job, **laboratory: Any) -> Any:
    """The `Case` of a job: each effect in turn, sizes random.  laboratory: as in `cohort.draw`."""
    from plumbline.simulate import cohort

    kind, number, seed = job
    pool = {"one": list(cohort.INSIDE), "outside": list(cohort.BEYOND)}.get(kind)
    names = (pool[number % len(pool)],) if pool else ()
    share = LARGE if kind == "two" else (0.0, 1.0)
    own = 10_000 * (10 * seed + cohort.KINDS.index(kind)) + number  # no two studies share a seed
    return cohort.draw(own, kind, names=names, share=share, **laboratory)


def study(job: Job, judge: Judge | None = None, **laboratory: Any) -> dict[str, Any]:
    """Draw, simulate and judge one study: its line.  judge: tables -> verdict; plumbline's own where not given."""
    from benchmarks._study import Stages

    line: dict[str, Any] = {"kind": job[0], "number": job[1], "seed": job[2], "alone": {}, "spent": {}, "verdict": None, "error": ""}
    try:
        case = case_of(job, **laboratory)
        line["truth"] = case.truth()
        judge, stages = judge or _own_judge(), Stages(case)
        stages.plant()
        tables = stages.control()
        start = time.process_time()
        verdict = judge(tables)
        line["spent"] = stages.spent | {"judge": round(time.process_time() - start, 2)}
        line["verdict"] = {ledger: verdict[ledger] for ledger in _score.LEDGERS}
        line["alone"] = _alone(case, line["truth"])
    except Exception:
        line["error"] = traceback.format_exc()
    return line


def _own_judge() -> Judge:
    """The project's own."""
    from plumbline.whole import verdict_of_tables

    return verdict_of_tables


def _alone(case: Any, truth: Mapping[str, Any]) -> dict[str, list[float]]:
    """Base error and noise floor [mm] of the same study with one effect only, where two share the plant."""
    from dataclasses import replace

    from benchmarks._study import Stages
    from plumbline.simulate import cohort

    if len(truth["plant"]) < 2:
        return {}
    return {
        called: list(Stages(replace(case, effects={name: sizes})).base_error())
        for name, sizes in case.effects.items() if (called := cohort.CALLED.get(name, name)) in truth["plant"]
    }  # fmt: skip


def run(jobs: Sequence[Job], file: Path, processes: int, **options: Any) -> list[dict[str, Any]]:
    """All lines of a cohort; verdicts in the file are kept, the other studies made and added to it.  options: as in `study`."""
    file.parent.mkdir(parents=True, exist_ok=True)
    lines = [line for line in _read(file) if not line["error"]] if file.exists() else []
    known = {(line["kind"], line["number"], line["seed"]) for line in lines}
    todo = [job for job in jobs if job not in known]
    start = time.time()
    with file.open("a", encoding="utf-8") as handle, contextlib.closing(_made(todo, processes, options)) as made:
        for i, line in enumerate(made, 1):
            text = json.dumps(line, default=float)
            handle.write(text + "\n")
            handle.flush()
            lines.append(json.loads(text))
            print(f"\r{i} of {len(todo)} studies, {time.time() - start:.0f} s", end="\n" * (i == len(todo)), file=sys.stderr, flush=True)
    return [line for line in lines if (line["kind"], line["number"], line["seed"]) in set(jobs)]


def _made(jobs: Sequence[Job], processes: int, options: Mapping[str, Any]) -> Generator[dict[str, Any], None, None]:
    """Lines as they are done, in this process or in several."""
    if processes < 2 or len(jobs) < 2:
        yield from (study(job, **options) for job in jobs)
        return
    with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=50) as pool:
        yield from pool.imap_unordered(functools.partial(study, **options), jobs)


def _read(file: Path) -> Iterator[dict[str, Any]]:
    """Whole lines of a file; one that was cut short by a broken run is passed over."""
    for text in file.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            print(f"{file}: a line was cut short; its study is made again", file=sys.stderr)


def draw(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Power curves: for each effect whether it was found (dots) against its error in noise floors, and a running share with its band."""
    from plumbline.figures import _style as style

    effects = sorted({str(row["effect"]) for row in rows})
    figure = style.page(1.6 * max(1, math.ceil(len(effects) / COLUMNS)))
    panels = figure.subplots(max(1, math.ceil(len(effects) / COLUMNS)), COLUMNS, sharex=True, sharey=True, squeeze=False)
    for panel, effect in zip(panels.flat, effects, strict=False):
        mine = sorted((row["floors"], row["found"]) for row in rows if row["effect"] == effect)
        x, y = [max(m[0], 0.8) for m in mine], [float(m[1]) for m in mine]
        panel.plot(x, y, ".", color=style.MEASURED, alpha=0.5)
        smooth = [_near(mine, at) for at in x]
        panel.plot(x, [s[0] for s in smooth], color=style.MODEL)
        panel.fill_between(x, [s[1] for s in smooth], [s[2] for s in smooth], color=style.MODEL, alpha=0.15, linewidth=0)
        panel.axvline(_score.VISIBLE, color=style.FAINT, zorder=0)
        panel.set_title(effect)
        panel.set_xscale("log")
        panel.set_ylim(-0.05, 1.05)
    for panel in panels.flat[len(effects) :]:
        panel.set_axis_off()
    figure.supxlabel("error without the effect in the model / noise floor")
    figure.supylabel("found")
    return figure


def _near(mine: Sequence[tuple[float, bool]], at: float, factor: float = 1.6) -> tuple[float, float, float]:
    """Share found, with its interval, among studies whose size is within a factor."""
    near = [hit for size, hit in mine if at / factor <= max(size, 0.8) <= at * factor]
    return (sum(near) / len(near), *_score.wilson(sum(near), len(near)))


def report(lines: Sequence[dict[str, Any]], folder: Path) -> str:
    """Tables as text; power.svg and power.parquet go to the folder."""
    import pandas as pd

    from plumbline.effects import catalogue
    from plumbline.figures._style import save, styled

    rows = _score.power(lines)
    pd.DataFrame(rows, columns=["effect", "floors", "found"]).to_parquet(folder / "power.parquet")
    save(styled(draw)(rows), folder / "power.svg")
    cpu = sorted(sum(v for k, v in line["spent"].items() if k != "motion") for line in lines if line["spent"])
    took = f"processor time per study: median {cpu[len(cpu) // 2]:.1f} s, most {cpu[-1]:.1f} s" if cpu else ""
    lost = [f"{line['kind']} {line['number']}: {line['error'].strip().splitlines()[-1]}" for line in lines if line["error"]]
    return "\n\n".join([table(_score.rates(lines, len(catalogue()))), table(_score.of_effects(lines)), took, *lost[:5]])


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Options of the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.discovery", description=(__doc__ or "").splitlines()[0])
    for name, count in (("clean", 300), ("effects", 300), ("outside", 60), ("pairs", 60)):
        parser.add_argument(f"--{name}", type=int, default=count, help=f"studies of this kind ({count})")
    parser.add_argument("--seed", type=int, default=None, help="of the cohort; drawn where not given")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/discovery"), help="folder of the lines and the figure")
    return parser.parse_args(arguments)


def begin(arguments: Sequence[str]) -> int:
    """Run the cohort and print its tables."""
    os.environ.update(ENVIRONMENT)  # before anything imports numpy
    options = parsed(arguments)
    seed = options.seed if options.seed is not None else secrets.randbelow(10**6)
    print(f"cohort of seed {seed} in {options.out}", flush=True)
    jobs = plan(options.clean, options.effects, options.outside, options.pairs, seed)
    lines = run(jobs, options.out / f"seed-{seed}.jsonl", options.jobs)
    print(report(lines, options.out))
    return 0


if __name__ == "__main__":
    sys.exit(begin(sys.argv[1:]))
