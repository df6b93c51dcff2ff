"""What the method does for forty people: one row per person, way of calibrating and motion it is judged on; and a table with goals."""

import resource
from collections.abc import Callable, Iterable, Iterator, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from gonzalez2013 import estimators as es
from gonzalez2013.people import Protocol, Seen, judged, measured, person, seen, standing
from plumbline import guidance, poses
from plumbline.figures import _style as figures
from plumbline.models.sesc import USUAL
from plumbline.person_com import columns
from plumbline.sesc import HOLD, hold_sd
from plumbline.simulate import multi_contact as mc
from plumbline.simulate import nine_segments as nine

Array = NDArray[np.float64]

PEOPLE, MANY = 40, 1000
TIMES = (0.25, 1.0, 4.0)  # spread of the prior over the published one
STARTS = (0.003, 0.01, 0.02, 0.05, 0.1, 0.3, 1.0)  # [m] what the paper's recursion may believe of its start
FORCE = 0.02  # [m/s2] noise of F/m: 1.4 N in 70 kg
FRAMES = 300
HOLDS = 4
NAMES = {"static": "paper's protocol", "extended": "extended protocol"}
HELD = {"standing": "all standing", "lie": "one lying"}


class Way(NamedTuple):
    """A way of calibrating: from which motion, with which instruments, and the estimator."""

    motion: str
    perfect: bool
    fit: Callable[[Seen, int], es.Told]


def _plain(motion: str, estimator: es.Estimator) -> Callable[[Seen, int], es.Told]:
    return lambda p, seed: estimator.fit([p.scenes[motion]])


def _prior(motion: str, times: float, wrong: bool = False) -> Callable[[Seen, int], es.Told]:
    def fit(p: Seen, seed: int) -> es.Told:
        s = p.scenes[motion]
        sign = np.random.default_rng([seed, 41]).choice([-1.0, 1.0], len(s.columns.parameters))
        return es.of_calibration(es.calibrated([s], times, sign if wrong else None))

    return fit


def _start(sd: float, zero: bool) -> Callable[[Seen, int], es.Told]:
    return lambda p, seed: es.kalman([p.scenes["static"]], np.zeros(7) if zero else p.scenes["static"].table_parameters(), sd)


def _pulled(p: Seen, seed: int) -> es.Told:
    """With m a = F of the standing-up."""
    noise = np.random.default_rng([seed, 42]).normal(0.0, FORCE, p.accelerated["sts"].shape)
    return es.with_acceleration([p.scenes["extended"]], p.scenes["sts"], p.accelerated["sts"] + noise, FORCE)


def ways() -> dict[str, Way]:
    """Every way that is compared."""
    out = {k: Way("static", True, _plain("static", e)) for k, e in es.PAPER.items()}
    out |= {f"prior x {t:g}": Way("static", True, _prior("static", t)) for t in TIMES}
    out |= {"prior wrong": Way("static", True, _prior("static", 1.0, wrong=True))}
    out |= {f"from {w}, {sd:g} m": Way("static", True, _start(sd, w == "zero")) for w in ("zero", "table") for sd in STARTS}
    batch, worse = es.PAPER["batch"], {"least squares": es.seven, "total least squares": es.total_least_squares, "wandering": es.wandering}
    out |= {
        "extended": Way("extended", True, _plain("extended", batch)),
        "extended, real": Way("extended", False, _plain("extended", batch)),
    }
    out |= {"extended, real, prior x 4": Way("extended", False, _prior("extended", 4.0))}
    out |= {f"extended, real, {k}": Way("extended", False, _plain("extended", es.Estimator(k, f))) for k, f in worse.items()}
    return out | {
        "extended, real, m a = F": Way("extended", False, _pulled),
        "table, real": Way("extended", False, _plain("extended", es.PAPER["table"])),
    }


def measure(plan: Protocol, people: Sequence[nine.Body]) -> pd.DataFrame:
    """Columns: subject, way, motion, and those of :func:`judged`."""
    return pd.DataFrame(list(_rows(plan, people)))


def _rows(plan: Protocol, people: Iterable[nine.Body]) -> Iterator[dict[str, Any]]:
    for who in people:
        seed = int(who.participant_id.rsplit("-", 1)[1])
        both = {perfect: person(plan, who, perfect) for perfect in (True, False)}
        for name, way in ways().items():
            p = both[way.perfect]
            told = way.fit(p, seed)
            for motion in plan.motions:
                yield {"subject": who.participant_id, "way": name, "motion": motion} | judged(*told(p.scenes[motion]), p.com[motion])


def covered(plan: Protocol, count: int = MANY) -> pd.DataFrame:
    """Bands of the paper's protocol in many people: one person's vertical error hardly changes, so that forty are forty draws.

    Columns: subject, and those of :func:`judged` on the volume.
    """
    some = Protocol({k: plan.motions[k] for k in ("static", "volume")})
    out = []
    for who in nine.cohort(count):
        p = person(some, who)
        out.append({"subject": who.participant_id} | judged(*es.batch([p.scenes["static"]])(p.scenes["volume"]), p.com["volume"]))
    return pd.DataFrame(out)


# -- what the protocols can tell --------------------------------------------------------------------------------------


def observed(plan: Protocol, people: Sequence[nine.Body]) -> pd.DataFrame:
    """Per protocol and person: how far the vertical rests on the prior, the flag, predicted sd.

    The volume is the intended motion. Columns: protocol, subject, rests, observable, floor, misfit, windows, sd_x, sd_y, sd_z.
    """
    motion = _thin(plan.scenes["volume"].columns.basis)
    out = []
    for who in people:
        one = person(plan, who)
        for name in ("static", "extended"):
            c = es.calibrated([one.scenes[name]])
            rests = guidance.rests_on_prior(c.rows.matrix, c.posterior.prior.covariance[: c.count, : c.count], motion)
            sd = np.hypot(guidance.mean_spread(motion, c.covariance), c.noise.floor)
            row = {"protocol": name, "subject": who.participant_id, "rests": rests, "observable": rests < guidance.RESTS}
            row |= {"floor": c.noise.floor, "misfit": c.posterior.misfit, "windows": len(c.directions)}
            out.append(row | {f"sd_{a}": v for a, v in zip("xyz", sd, strict=True)})
    return pd.DataFrame(out)


def designed(plan: Protocol, count: int = 5) -> pd.DataFrame:
    """Poses chosen one after the other for the volume: columns among, hold, pose, sd_x, sd_y, sd_z.

    among: standing, or with one seated (sit) or lying (lie) pose first.
    """
    motion = _thin(plan.scenes["volume"].columns.basis)
    basis = np.concatenate([motion, np.zeros((len(motion), 3, 2))], axis=2)
    prior = plan.scenes["volume"].columns.prior()
    cov = np.zeros((basis.shape[2],) * 2)
    cov[:-2, :-2], cov[-2:, -2:] = prior.covariance, USUAL.constant**2 * np.eye(2)
    sd = hold_sd(USUAL, HOLD)
    made = {name: np.hstack([columns(poses.posed(standing(), name)).basis[0, :2], np.eye(2)]) for name in poses.POSES}
    upright = [k for k in made if k.startswith(("stand", "squat", "half"))]
    out = []
    for among in ("standing", "sit", "lie"):
        now = cov
        for i in range(1, count + 1):
            some = [k for k in made if k.startswith(among)] if i == 1 and among != "standing" else upright
            step = guidance.next_poses(now, basis, {k: made[k] for k in some}, sd)[0]
            now = guidance.after(now, made[step.pose] / sd)
            row = {"among": among, "hold": i, "pose": step.pose}
            out.append(row | {f"sd_{a}": v for a, v in zip("xyz", np.hypot(step.sd, USUAL.floor), strict=True)})
    return pd.DataFrame(out)


def _thin(basis: Array) -> Array:
    return np.asarray(basis[np.unique(np.linspace(0, len(basis) - 1, FRAMES).astype(int))])


def timed(plan: Protocol, people: Sequence[nine.Body]) -> pd.DataFrame:
    """Seconds for the paper's protocol from markers and plates: parts of one person, and all of them.  Columns: what, value, unit, goal."""
    spent = dict.fromkeys(("windows", "fit"), 0.0)
    truth = [mc.record(plan.motions["static"], who, i) for i, who in enumerate(people, 1)]
    for r in truth:
        start = perf_counter()
        s = measured(seen(r.motion, r.motion.pose), r.ground)
        made = perf_counter()
        es.calibrated([s])
        spent["windows"] += made - start
        spent["fit"] += perf_counter() - made
    n = len(people)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024  # [MB] where the system counts in kB
    rows = [
        ("one fit from windows", spent["fit"] / n, "s", "<= 0.2"),
        ("its windows from markers and forces", spent["windows"] / n, "s", ""),
    ]
    rows += [(f"{n} people, both", sum(spent.values()), "s", "<= 60"), ("largest memory of the process", peak, "MB", "")]
    return pd.DataFrame(rows, columns=["what", "value", "unit", "goal"])


# -- the table --------------------------------------------------------------------------------------------------------


class Line(NamedTuple):
    """One row of the table.  statistic: median, p90 or mean over people of `value`.  paper, goal: as text, empty where none."""

    what: str
    way: str
    motion: str
    value: str
    statistic: str
    unit: str = "mm"
    paper: str = ""
    goal: str = ""


LINES = (
    Line("same 300 s, 3-D, median", "batch", "static", "distance", "median", paper="19.65", goal="<= 7"),
    Line("same 300 s, 3-D, 90 % of people", "batch", "static", "distance", "p90", goal="<= 15"),
    Line("the same, segment table, median", "table", "static", "distance", "median"),
    Line("the same, segment table, 90 % of people", "table", "static", "distance", "p90"),
    Line("ground projection", "batch", "static", "ground", "median", paper="6.09", goal="<= 1.5"),
    Line("the same, segment table", "table", "static", "ground", "median"),
    Line("held-out volume, 3-D", "batch", "volume", "distance", "median", paper="19.65"),
    Line("sit-to-stand, 3-D", "batch", "sts", "distance", "median", paper="25.68", goal="<= 7"),
    Line("the same, segment table", "table", "sts", "distance", "median"),
    Line("extended protocol, 3-D", "extended", "extended", "distance", "median", goal="<= 3.0"),
    Line("the same, judged on the volume", "extended", "volume", "distance", "median"),
    Line("the same, judged on the sit-to-stand", "extended", "sts", "distance", "median"),
    Line("extended, imperfect instruments, 3-D", "extended, real", "extended", "distance", "median", goal="<= 5.0"),
    Line("the same, segment table", "table, real", "extended", "distance", "median"),
    Line("band of 95 % upwards, paper's protocol", "batch", "volume", "cover_z", "mean", "1"),
    Line("band of 95 % upwards, extended", "extended", "volume", "cover_z", "mean", "1"),
    Line("band of 95 % upwards, extended, imperfect", "extended, real", "volume", "cover_z", "mean", "1"),
    *(Line(f"prior x {t:g}, 3-D", f"prior x {t:g}", "static", "distance", "median") for t in TIMES),
    *(Line(f"prior x {t:g}, band of 95 % upwards", f"prior x {t:g}", "static", "cover_z", "mean", "1") for t in TIMES),
    Line("prior's mean wrong by 1 sd, 3-D", "prior wrong", "static", "distance", "median"),
    Line("prior's mean wrong by 1 sd, band of 95 % upwards", "prior wrong", "static", "cover_z", "mean", "1"),
    Line("paper's recursion from zero, 3-D", "kalman_zero", "static", "distance", "median"),
    Line("the same, bounded", "kalman_bounded", "static", "distance", "median"),
    Line("paper's recursion from a weak prior, 3-D", "kalman_weak", "static", "distance", "median"),
    Line("imperfect: seven parameters by least squares, no prior, 3-D", "extended, real, least squares", "extended", "distance", "median"),
    Line("imperfect: the same by total least squares, 3-D", "extended, real, total least squares", "extended", "distance", "median"),
    Line("imperfect: wandering parameters, 3-D", "extended, real, wandering", "extended", "distance", "median"),
    Line("imperfect: with m a = F, 3-D", "extended, real, m a = F", "extended", "distance", "median"),
)


def summary(rows: pd.DataFrame, many: pd.DataFrame, flags: pd.DataFrame, holds: pd.DataFrame, times: pd.DataFrame) -> pd.DataFrame:
    """The table: what, value, unit, paper, goal, met ("" without a goal).  Arguments: tables of the functions above."""
    out = [_of_people(rows, line) for line in LINES]
    out.append((f"band of 95 % upwards, paper's protocol, {len(many)} people", float(many["cover_z"].mean()), "1", "", "0.90-0.99"))
    out.append((f"held-out volume, 3-D, median of {len(many)} people", 1e3 * float(many["distance"].median()), "mm", "19.65", ""))
    out.append((f"the same, 90 % of {len(many)} people", 1e3 * float(many["distance"].quantile(0.9)), "mm", "", ""))
    for protocol, goal in (("static", "0-0"), ("extended", "1-1")):
        mine = flags[flags["protocol"] == protocol]
        out.append((f"vertical called observable, {NAMES[protocol]}", float(mine["observable"].mean()), "1", "", goal))
        out.append((f"vertical error grows with a prior x 4, {NAMES[protocol]}", float(mine["rests"].median()), "1", "", ""))
        out.append((f"predicted vertical sd, {NAMES[protocol]}", 1e3 * float(mine["sd_z"].median()), "mm", "", ""))
    for among, goal in (("standing", "<= 6"), ("lie", "<= 3.5")):
        sd = holds.loc[(holds["among"] == among) & (holds["hold"] == HOLDS), "sd_z"]
        out.append((f"four designed holds of {HOLD:g} s, {HELD[among]}: predicted vertical sd", 1e3 * float(sd.iloc[0]), "mm", "", goal))
    out += [(t.what, t.value, t.unit, "", t.goal) for t in figures.rows(times)]
    table = pd.DataFrame(out, columns=["what", "value", "unit", "paper", "goal"])
    return table.assign(met=[_met(v, g) for v, g in zip(table["value"], table["goal"], strict=True)])


def _of_people(rows: pd.DataFrame, line: Line) -> tuple[str, float, str, str, str]:
    values = rows.loc[(rows["way"] == line.way) & (rows["motion"] == line.motion), line.value]
    number = float(values.mean()) if line.statistic == "mean" else float(values.quantile(0.5 if line.statistic == "median" else 0.9))
    return line.what, number * (1e3 if line.unit == "mm" else 1.0), line.unit, line.paper, line.goal


def _met(value: float, goal: str) -> str:
    if not goal:
        return ""
    low, high = (0.0, float(goal[3:])) if goal.startswith("<=") else map(float, goal.split("-"))
    return "yes" if low <= value <= high else "no"
