"""Returning RLS against padasip's FilterRLS, updates per second on one core.

Both estimate the same loci (simulated, 800 frames) with the same P0 and forgetting factor; padasip, one locus after another, on
the first `SHARE` of them. An update is one frame of one locus in one direction. Time is that of the processor; the best of several
rounds counts for either, taken before and after the other, and the ratio of the medians stands beside it.
"""

import hashlib
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbline import filters, rls
from plumbline.bootstrap import BIN, ENVIRONMENT
from plumbline.simulate import pendulum

Array = NDArray[np.float64]

HERE = Path(__file__).resolve().parent
LOCI, FRAMES, RATE = 128, 800, 200.0
SHARE = 16  # loci that padasip gets
EPS = 1e-3  # padasip's default; its P0 is 1/eps
ROUNDS = 40
GOAL = 500  # times padasip


def main(options: Sequence[str] = ()) -> list[dict[str, Any]]:
    """One row per number of parameters and forgetting factor.  There are no options."""
    if options:
        raise SystemExit(f"rls takes no options, not {' '.join(options)}")
    with one_core():
        problems = [(y, phi, mu) for y, phi in data() for mu in (1.0, 0.99)]
        early = [rounds(y, phi, mu) for y, phi, mu in problems]
        theirs = padasip(problems)
        late = [rounds(y, phi, mu) for y, phi, mu in problems]
    return [row(*one) for one in zip(problems, early, late, theirs, strict=True)]


def row(
    problem: tuple[Array, list[Array], float], early: dict[str, Array], late: dict[str, Array], theirs: tuple[Array, Array, Array]
) -> dict[str, Any]:
    """Speeds [million updates/s], their ratio, and the largest difference of any estimate, relative to its norm."""
    y, phi, mu = problem
    forward, back, seconds = theirs
    there, again = rls.returning(y[:, :SHARE], [f[:, :SHARE] for f in phi], forgetting=mu, p0=1 / EPS, reset=1 / EPS)
    apart = max(difference(there.theta, forward), difference(again.theta, back))
    one, both = (np.concatenate([early[k], late[k]]) / y.size for k in ("forward", "returning"))
    peer, returned = seconds / y[:, :SHARE].size, both / 2
    return {
        "parameters": len(phi),
        "forgetting": mu,
        "forward [M/s]": float(1e-6 / one.min()),
        "returning [M/s]": float(1e-6 / returned.min()),
        "padasip [M/s]": float(1e-6 / peer.min()),
        "ratio": round(peer.min() / returned.min()),
        "of medians": round(float(np.median(peer) / np.median(returned))),
        "goal": GOAL,
        "difference": float(apart),
    }


def difference(a: Array, b: Array) -> float:
    """Largest |a - b| over |b| of any frame and locus; both (c, n, m)."""
    return float(np.max(np.linalg.norm(a - b, axis=0) / np.linalg.norm(b, axis=0)))


def data() -> Iterator[tuple[Array, list[Array]]]:
    """omega^2 from x'' and x - p; the law from x, x'; the law with a free reference.  Loci: pendulum, Murai's set A, seed 31."""
    loci = [one for one in pendulum.loci(2 * LOCI, omega=2.740, k1=4.038, k2=0.875, seed=31) if len(one.x) >= FRAMES][:LOCI]
    x = np.column_stack([one.x[:FRAMES] for one in loci])
    p = np.column_stack([one.p[:FRAMES] for one in loci])
    x = filters.low_pass(x, loci[0].time[:FRAMES], 6.0)
    v, a = filters.derivatives(x, loci[0].time[:FRAMES])
    assert x.shape == (FRAMES, LOCI)
    yield a, [x - p]
    yield p, [x, v]
    yield p, [np.ones_like(x), x, v]


def rounds(y: Array, phi: list[Array], mu: float) -> dict[str, Array]:
    """Seconds per call of the forward pass and of both passes."""
    calls: dict[str, Callable[[], object]] = {
        "forward": lambda: rls.forward(y, phi, forgetting=mu, p0=1 / EPS),
        "returning": lambda: rls.returning(y, phi, forgetting=mu, p0=1 / EPS, reset=1 / EPS),
    }
    out = {}
    for name, call in calls.items():
        seconds = np.empty(ROUNDS)
        for k in range(-3, ROUNDS):  # three to warm up
            begin = time.process_time()
            call()
            seconds[k] = time.process_time() - begin
        out[name] = seconds
    return out


def padasip(problems: list[tuple[Array, list[Array], float]]) -> list[tuple[Array, Array, Array]]:
    """Its estimates forward and back, each (c, n, SHARE), and the seconds of its forward rounds, per problem."""
    some = [(y[:, :SHARE], np.array(phi)[:, :, :SHARE], mu) for y, phi, mu in problems]
    there = _ask([(y, phi, mu, np.zeros(phi.shape[::2])) for y, phi, mu in some])
    turned = [(y[::-1], phi[:, ::-1], mu, theta[:, -1]) for (y, phi, mu), (theta, _) in zip(some, there, strict=True)]
    back = _ask(turned)
    return [(a, b[:, ::-1], np.concatenate([s, t])) for (a, s), (b, t) in zip(there, back, strict=True)]


def _ask(cases: list[tuple[Array, Array, float, Array]]) -> list[tuple[Array, Array]]:
    with tempfile.TemporaryDirectory() as folder:
        asked, answered = Path(folder) / "cases.npz", Path(folder) / "answers.npz"
        arrays: dict[str, Any] = {"count": len(cases), "eps": EPS}
        for k, case in enumerate(cases):
            arrays |= {f"{name}_{k}": value for name, value in zip(("y", "phi", "mu", "start"), case, strict=True)}
        np.savez(asked, **arrays)
        subprocess.run([peers(), HERE / "_padasip.py", asked, answered], check=True, env=os.environ | ENVIRONMENT)
        with np.load(answered) as answers:
            return [(answers[f"theta_{k}"], answers[f"seconds_{k}"]) for k in range(len(cases))]


def peers() -> Path:
    """Python of the peers' environment, made from peers.lock by the project's uv unless it is up to date."""
    folder, lock = HERE / ".venv", HERE / "peers.lock"
    python, stamp = folder / BIN.name / "python", folder / "plumbline.stamp"
    state = hashlib.sha256(lock.read_bytes()).hexdigest()
    if not (stamp.is_file() and stamp.read_text() == state):
        uv = BIN / "uv"
        subprocess.run([uv, "venv", "-q", "--clear", "--python", BIN / "python", folder], check=True)
        subprocess.run([uv, "pip", "install", "-q", "--python", folder, "--require-hashes", "-r", lock], check=True)
        stamp.write_text(state)
    return python


@contextmanager
def one_core() -> Iterator[None]:
    """Keep this process and its children on one core, where the system allows it."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
