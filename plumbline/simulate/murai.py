r"""The one subject of Murai 2013 as raw files: 128 recordings of a man who is pushed sideways while he stands, with the truth beside them.

Every recording is one disturbance: quiet standing, a push (an `events` row), then one locus of `pendulum.loci`, whose omega,
gains and limits are prescribed. During the push the CoM follows the one quintic that joins both ends in position, velocity and
acceleration, and the CoP moves smoothly from one end to the other; the pusher gives :math:`m \ddot x - F_x`. His hands lose
contact :data:`LET_GO` before the locus, and the mark of the push ends :data:`LATE` before it: between them the man falls freely over
a CoP at rest, so that no low-pass of 6 Hz or more smears the push into the locus. But for the push
:math:`F_x = m \ddot x = m \omega^2 (x - p)`, and :math:`F_z = m g` at a constant height.

The omegas are the published ones and do not belong to a CoM 1 m high (g/z gives 3.13 rad/s): which mechanism would make them is
the open question of the paper, so none is simulated. The forward axis is quiet standing with g/z.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.physics import G
from plumbline.simulate import pendulum

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array]  # x [m], x' [m/s], p [m] of one stretch, each (n,)

SEED = 2013
PUSH = 1.0  # [s] hands in contact
LET_GO = 0.2  # [s] from their last contact until he follows his law
LATE = 0.08  # [s] by which the mark of a push ends before that: hands leave a little after a mark
QUIET = 2.0  # [s] before the push
SETTLE = 3.0  # [s] a quiet stretch begins this long after a small disturbance
FOOT_HALF_WIDTH = 0.05  # [m]
FOOT = {"HEE": -0.06, "TOE": 0.20}  # [m] y of the markers on a foot's middle line


class Kind(NamedTuple):
    """One kind of locus: its start (see `pendulum.loci`), how long it is recorded [s], whether it has the near loci's omega."""

    start: pendulum.Start
    duration: float
    near: bool


KINDS = {
    "unsaturated": Kind("unsaturated", 4.0, True),
    "saturated": Kind("saturated", 4.0, True),
    "beyond": Kind("beyond", 4.0, False),
    "falling": Kind("falling", 4.0, False),  # ends where the CoM is 0.3 m away
    "leaving": Kind("leaving", 4.0, False),  # falls too, but the ZMP is inside its limits at first
    "unrecovered": Kind("beyond", 1.0, False),  # the record stops while he is still on his way back
}
MIX = {"unsaturated": 16, "saturated": 16, "beyond": 12, "falling": 6, "leaving": 6, "unrecovered": 8}  # loci of one condition


class Condition(NamedTuple):
    """omega of the far and the near loci [rad/s], gains k1 [1] and k2 [s]."""

    far: float
    near: float
    k1: float
    k2: float


@dataclass(frozen=True)
class Truth:
    """What is prescribed.  conditions: by BIDS acq.  left, right: limits of the ZMP and outer edges of the feet [m].  d: reference [m].
    z: height of the CoM [m].

    Noise, all white but the feedback's: marker, cop [m]; shear, load [N]; feedback noise of the wanted ZMP [m], [s].
    """

    conditions: Mapping[str, Condition] = field(
        default_factory=lambda: {"free": Condition(2.117, 2.740, 4.038, 0.875), "held": Condition(2.808, 2.914, 2.204, 0.549)}
    )
    left: float = -0.100
    right: float = 0.100
    d: float = 0.008
    mass: float = 70.0
    z: float = 1.0
    rate: float = 200.0
    marker_noise: float = 1e-3
    cop_noise: float = 1e-3
    shear_noise: float = 0.5
    load_noise: float = 1.0
    feedback_sd: float = 3e-3
    feedback_time: float = 0.3


class Trial(NamedTuple):
    """One recording without sensor noise.

    x, p, a: lateral CoM [m], CoP [m], floor shear over mass [m/s2]; y, q, b: the same forward; each (n,).  onset: of the push [s].
    truth: what was prescribed, for truth.json.
    """

    condition: str
    x: Array
    p: Array
    a: Array
    y: Array
    q: Array
    b: Array
    onset: float
    truth: dict[str, object]


def write(folder: Path, truth: Truth | None = None, *, mix: Mapping[str, int] = MIX, seed: int = SEED) -> None:
    """Write `folder`/raw/sub-01/*.parquet with their events, and `folder`/truth.json.

    truth: values prescribed, the paper's without it.  mix: loci of each of :data:`KINDS` per condition.  Raises FileExistsError
    where raw holds recordings: they are not ours to replace.
    """
    truth = truth or Truth()
    where = folder / "raw" / "sub-01"
    if where.is_dir() and any(where.iterdir()):
        raise FileExistsError(f"{where} is not empty; remove it to simulate anew")
    where.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    told = []
    for acq in truth.conditions:
        made = trials(truth, acq, mix, rng)
        for run, k in enumerate(rng.permutation(len(made)), 1):
            name = f"sub-01_task-lateral_acq-{acq}_run-{run:03d}"
            _write_parquet(where / f"{name}.parquet", _recorded(made[k], truth, rng))
            events = f"onset\tduration\ttrial_type\n{made[k].onset:.3f}\t{PUSH + LET_GO - LATE:.3f}\tpush\n"
            (where / f"{name}_events.tsv").write_text(events, encoding="utf-8")
            told.append({"trial": name, "condition": acq} | made[k].truth)
    known = {**asdict(truth), "conditions": {acq: c._asdict() for acq, c in truth.conditions.items()}}
    (folder / "truth.json").write_text(json.dumps({"seed": seed, **known, "loci": told}, indent=1) + "\n", encoding="utf-8")


def trials(truth: Truth, acq: str, mix: Mapping[str, int], rng: np.random.Generator) -> list[Trial]:
    """The recordings of one condition, kind by kind."""
    about = truth.conditions[acq]
    longest = QUIET + PUSH + LET_GO + max(kind.duration for kind in KINDS.values())
    ahead = iter(_stand(truth, about, float(np.sqrt(G / truth.z)), longest, sum(mix.values()), rng))
    out = []
    for near in (False, True):
        omega = about.near if near else about.far
        loci = [(name, locus) for name, kind in KINDS.items() if kind.near is near for locus in _loci(truth, about, name, mix, rng)]
        stand = _stand(truth, about, omega, QUIET, len(loci), rng) if loci else []
        out += [_trial(truth, acq, omega, locus, rest, next(ahead)) for locus, rest in zip(loci, stand, strict=True)]
    return out


def _loop(truth: Truth, about: Condition) -> dict[str, float]:
    """Options of `pendulum.loci` that all loci share; sensor noise is added to the whole recording later."""
    return {
        "k1": about.k1, "k2": about.k2, "rate": truth.rate, "marker_noise": 0.0, "cop_noise": 0.0,
        "feedback_sd": truth.feedback_sd, "feedback_time": truth.feedback_time,
    }  # fmt: skip


def _loci(truth: Truth, about: Condition, name: str, mix: Mapping[str, int], rng: np.random.Generator) -> list[pendulum.Locus]:
    kind, n = KINDS[name], mix.get(name, 0)
    if not n:
        return []
    return pendulum.loci(
        n, omega=about.near if kind.near else about.far, d=truth.d, limits=(truth.left, truth.right), start=kind.start,
        duration=kind.duration, seed=int(rng.integers(2**31)), **_loop(truth, about),
    )  # fmt: skip


def _stand(truth: Truth, about: Condition, omega: float, duration: float, n: int, rng: np.random.Generator) -> list[Motion]:
    """Quiet standing about d [m]: the last `duration` [s] after a small disturbance has died out, n times."""
    whole = pendulum.loci(
        n, omega=omega, d=truth.d, limits=(truth.left, truth.right), start="unsaturated", duration=SETTLE + duration,
        seed=int(rng.integers(2**31)), **_loop(truth, about),
    )  # fmt: skip
    last = round(duration * truth.rate) + 1
    return [(one.x_true[-last:], one.v_true[-last:], one.p_true[-last:]) for one in whole]


def _trial(truth: Truth, acq: str, omega: float, named: tuple[str, pendulum.Locus], stand: Motion, ahead: Motion) -> Trial:
    """Quiet standing, the push, the locus."""
    name, locus = named
    x, v, p = stand
    p0 = locus.p_true[0]
    before = np.arange(-round(LET_GO * truth.rate), 0) / truth.rate  # [s] before the locus begins
    fall, speed = _free(omega, locus.x_true[0] - p0, locus.v_true[0], before)
    share = np.arange(1, round(PUSH * truth.rate)) / round(PUSH * truth.rate)  # of the contact gone by, both ends left out
    pushed = _quintic((x[-1], v[-1], omega**2 * (x[-1] - p[-1])), (p0 + fall[0], speed[0], omega**2 * fall[0]), share)
    between = p[-1] + (p0 - p[-1]) * share**3 * (10 - 15 * share + 6 * share**2)
    x = np.concatenate([x, pushed, p0 + fall, locus.x_true])
    p = np.concatenate([p, between, np.full(len(fall), p0), locus.p_true])
    y, _, q = (part[: len(x)] - truth.d for part in ahead)
    start = QUIET + PUSH + LET_GO
    told = {"kind": name, "omega": omega, "start": start, "switches": (start + locus.switches).tolist()}
    return Trial(acq, x, p, omega**2 * (x - p), y, q, G / truth.z * (y - q), QUIET, told)


def _free(omega: float, x: float, v: float, t: Array) -> tuple[Array, Array]:
    """Position over a CoP at rest [m] and velocity [m/s] at times t [s], from x and v at t = 0."""
    c, s = np.cosh(omega * t), np.sinh(omega * t)
    return np.asarray(x * c + v / omega * s), np.asarray(omega * x * s + v * c)


def _quintic(first: tuple[float, float, float], last: tuple[float, float, float], share: Array) -> Array:
    """Position [m] on the way between two states (position, velocity, acceleration), `share` of :data:`PUSH` gone by."""
    x, v, a = first[0], first[1] * PUSH, first[2] * PUSH**2
    x1, v1, a1 = last[0], last[1] * PUSH, last[2] * PUSH**2
    gap = np.array([x1 - x - v - a / 2, v1 - v - a, a1 - a])
    c3, c4, c5 = np.linalg.solve(np.array([[1.0, 1.0, 1.0], [3.0, 4.0, 5.0], [6.0, 12.0, 20.0]]), gap)
    s = share
    return np.asarray(x + v * s + a / 2 * s**2 + c3 * s**3 + c4 * s**4 + c5 * s**5)


def _recorded(trial: Trial, truth: Truth, rng: np.random.Generator) -> dict[str, Array]:
    """What the laboratory writes down: column -> (n,), with white noise."""
    n = len(trial.x)

    def noisy(value: Array | float, sd: float) -> Array:
        return np.asarray(value + sd * rng.standard_normal(n))

    out = {"time": np.arange(n) / truth.rate}
    out |= {f"com_{k}": noisy(value, truth.marker_noise) for k, value in (("x", trial.x), ("y", trial.y), ("z", truth.z))}
    out |= {f"force_{k}": noisy(truth.mass * value, truth.shear_noise) for k, value in zip("xy", (trial.a, trial.b), strict=True)}
    out["force_z"] = noisy(truth.mass * G, truth.load_noise)
    out |= {f"cop_{k}": noisy(value, truth.cop_noise) for k, value in zip("xy", (trial.p, trial.q), strict=True)}
    for side, x in (("L", truth.left + FOOT_HALF_WIDTH), ("R", truth.right - FOOT_HALF_WIDTH)):
        for name, y in FOOT.items():
            out |= {f"{side}{name}_{k}": noisy(value, truth.marker_noise) for k, value in zip("xyz", (x, y, 0.03), strict=True)}
    return out


def _write_parquet(path: Path, columns: Mapping[str, Array]) -> None:
    """Single precision, as loggers write; the time is kept double."""
    import pyarrow as pa  # here, as only writing needs it
    import pyarrow.parquet as pq

    table = pa.table({name: pa.array(value if name == "time" else value.astype(np.float32)) for name, value in columns.items()})
    pq.write_table(table, path, compression="zstd", use_dictionary=False)
