"""Ways to identify the piecewise controller, side by side: error, coverage of the 95 % interval, switching points, time.

One repetition is what a subject gives: 32 loci that start saturated and 32 that do not, 4 s at 200 Hz, 1 mm of noise on marker and CoP,
Ornstein-Uhlenbeck feedback noise of 0.3 s, both published parameter sets. Seeds: 1 + repetition.

    python -m benchmarks methods [--repetitions 400] [--noise 3]
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from plumbline import batch as batches
from plumbline import law as laws
from plumbline.batch import Batch
from plumbline.estimators import algebraic, bounded_error, k_plane

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from made_loci import PUBLISHED, RATE, switch_errors

from plumbline.simulate import pendulum

LIMITS = (-0.1, 0.1)
AT_ONCE = 10  # repetitions simulated together
COMPARED = 20  # repetitions of the methods that need seconds each


def main(argv: Sequence[str] = ()) -> None:
    """Print one table per parameter set."""
    parser = argparse.ArgumentParser(prog="methods", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=40)
    parser.add_argument("--noise", type=float, nargs="*", default=[3.0, 10.0], help="feedback noise [mm]")
    parser.add_argument("--delay", type=float, default=0.0, help="neural delay in the truth [s]")
    options = parser.parse_args(list(argv))
    for millimetres in options.noise:
        for name in PUBLISHED:
            rows = list(_study(name, millimetres * 1e-3, options.repetitions, options.delay))
            print(f"\nset {name}, {millimetres:g} mm of feedback noise, delay {options.delay:g} s, {options.repetitions} repetitions")
            print(_summary(pd.DataFrame(rows), name, options.delay).to_string(), flush=True)


def _study(name: str, noise: float, repetitions: int, delay: float) -> Iterator[dict[str, Any]]:
    for first in range(0, repetitions, AT_ONCE):
        count = min(AT_ONCE, repetitions - first)
        pools = [
            pendulum.loci(32 * count, start=start, seed=1 + 2 * first + k, feedback_sd=noise, delay=delay, limits=LIMITS, **PUBLISHED[name])
            for k, start in enumerate(("saturated", "unsaturated"))
        ]
        for r in range(count):
            loci = [one for pool in pools for one in pool[32 * r : 32 * (r + 1)]]
            yield from _repetition(loci, PUBLISHED[name]["omega"], first + r, delay)


def _repetition(loci: list[pendulum.Locus], omega: float, number: int, delay: float) -> Iterator[dict[str, Any]]:
    start = time.process_time()
    b = batches.of_loci([one.x for one in loci], [one.p for one in loci], omega, RATE)
    steady = np.ones(len(loci), bool)
    found = laws.regimes(b, omega, steady)
    spent = time.process_time() - start
    if found is None:
        raise RuntimeError(f"no law in repetition {number}")
    start = time.process_time()
    got = laws.identify(b, found.regime, omega, steady, delay=delay > 0)
    spent += time.process_time() - start
    if got is None or got.instruments is None:
        raise RuntimeError(f"no gains in repetition {number}")
    errors, missed, more = switch_errors(loci, found.regime, b.lead, LIMITS)
    about = {"switch": errors, "missed": missed, "more": more, "seconds": spent}
    kept = got.output_error
    yield _row("output error", kept.law, kept.covariance, kept.loci) | about | _limits(got)
    if got.delayed is not None:
        yield _row("output error with delay", got.delayed.law, got.delayed.covariance, got.delayed.loci) | {"delay": got.delayed.law.delay}
    yield _row("instruments", got.instruments.law, got.instruments.covariance, got.instruments.loci)
    least = got.saturation
    yield _row("least squares, by locus", least.law, least.covariance, least.loci)
    yield _row("least squares, naive", least.law, _naive(b, least.law, least.inside_rms), 10_000)
    if number < COMPARED and delay == 0:
        yield from _pieces(loci, b, number)


def _row(method: str, law: Any, covariance: np.ndarray, loci: int) -> dict[str, Any]:
    half = stdtrit(loci - 1, 0.975) * np.sqrt(np.diag(covariance))
    values = {"d": law.d, "k1": law.k1, "k2": law.k2}
    return {"method": method} | values | {f"{key}_half": half[i] for i, key in enumerate(values)}


def _limits(got: laws.Controller) -> dict[str, float]:
    law = got.output_error.law
    half = [stdtrit(n - 1, 0.975) * se for n, se in zip(got.limit_loci, got.limit_se, strict=True)]
    return {"left": law.left, "right": law.right, "left_half": half[0], "right_half": half[1]}


def _naive(b: Batch, law: Any, sd: float) -> np.ndarray:
    """What a textbook prints: every frame independent of every other."""
    free = b.inside & (law.region(b.x, b.v) == 0)
    columns = np.stack([np.full(b.x.shape, 1 - law.k1), b.x - law.d, b.v])[:, free]
    return sd**2 * np.linalg.inv(columns @ columns.T)


def _pieces(loci: list[pendulum.Locus], b: Batch, number: int) -> Iterator[dict[str, Any]]:
    """The piecewise-affine methods, on the same smoothed motion."""
    x, v, p = (a[b.lead :] for a in (b.x, b.v, b.p))
    for name, module in (("k-plane", k_plane), ("bounded error", bounded_error), ("algebraic", algebraic)):
        start = time.process_time()
        got = module.estimate(x, v, p, b.end - b.lead, b.rate, seed=number)
        spent = time.process_time() - start
        regime = np.where(np.abs(got.regime) > 1, 0, got.regime).astype(np.int8)
        errors, missed, more = switch_errors(loci, regime, 0, LIMITS)
        values = {"d": got.d, "k1": got.k1, "k2": got.k2, "left": got.left, "right": got.right}
        yield {"method": name} | values | {"switch": errors, "missed": missed, "more": more, "seconds": spent}


def _summary(rows: pd.DataFrame, name: str, delay: float) -> pd.DataFrame:
    truth = {"d": 0.0, "k1": PUBLISHED[name]["k1"], "k2": PUBLISHED[name]["k2"], "left": LIMITS[0], "right": LIMITS[1]}
    out = []
    for method, mine in rows.groupby("method", sort=False):
        line: dict[str, Any] = {"method": method, "n": len(mine)}
        for key in ("k1", "k2"):
            line[f"{key} bias %"] = round(100 * (mine[key].mean() / truth[key] - 1), 2)
            line[f"{key} sd %"] = round(100 * mine[key].std() / truth[key], 2)
        for key, value in truth.items():
            half = mine.get(f"{key}_half")
            if half is not None and half.notna().any():
                line[f"{key} cover"] = round(float((np.abs(mine[key] - value) <= half).mean()), 3)
        for key in ("d", "left", "right"):
            line[f"{key} bias mm"] = round(1e3 * (mine[key] - truth[key]).mean(), 2)
        if mine["switch"].notna().all():
            errors = np.abs(np.concatenate(mine["switch"].to_list()))
            line |= {"switch median ms": round(1e3 * np.median(errors), 1), "p90 ms": round(1e3 * np.percentile(errors, 90), 1)}
            line |= {"missed": mine["missed"].sum() / (len(errors) + mine["missed"].sum()), "too many": mine["more"].sum() / len(errors)}
            line["seconds"] = round(mine["seconds"].mean(), 3)
        if "delay" in mine and mine["delay"].notna().any():
            line |= {"delay bias ms": 1e3 * (mine["delay"].mean() - delay), "worst ms": 1e3 * np.abs(mine["delay"] - delay).max()}
        out.append(line)
    return pd.DataFrame(out).set_index("method").T.round(3)


if __name__ == "__main__":
    main(sys.argv[1:])
