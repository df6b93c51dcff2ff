r"""Each subject's own CoM from still poses, and what these poses cannot tell.

Per frame the own CoM with its predicted sd (table `sesc`), per parameter what was learnt (`chain`), per window what was used and why
not (`poses`), per subject what is observable and which pose to record next (`guidance`). The segment table's CoM stays beside it.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.linalg import block_diag

from plumbline import body, contact, forces, guidance, support
from plumbline.calibration import Calibration, Person, Trial, calibrates, person
from plumbline.errors import PlumblineError
from plumbline.filters import known
from plumbline.markerset import MarkerSet, choose
from plumbline.models.sesc import Noise, mean_covariance, spread
from plumbline.moving import equations as moving_rows
from plumbline.person_com import Columns, columns
from plumbline.poses import POSES, posed, straight
from plumbline.signals import Recording
from plumbline.still import Gate, windows
from plumbline.study import Participant, names
from plumbline.tables import joined

Array = NDArray[np.float64]

HOLD = 5.0  # [s] that a recommended pose is held
NEXT = 3  # poses that are recommended
FRAMES = 300  # frames of a subject that stand for what it does
REACH = 0.35  # [rad] from the nearest calibration pose, from which on a frame lies outside their range


def of_part(
    recordings: Iterable[Recording], people: Mapping[str, Participant], markers: str, *, masses: Mapping[str, float],
    tasks: Sequence[str], equations: Sequence[str], window: float, limit: float, sides: str, prior: float, left_out: Sequence[str] = (),
) -> dict[str, pd.DataFrame]:  # fmt: skip
    """Tables `sesc`, `chain`, `poses`, `guidance` of whole subjects, by name.

    people, markers, masses: as in :func:`plumbline.signals.of_part`.  tasks: tasks or trials that calibrate, empty: all.  equations:
    still, force, moment, which of them calibrate.  window: length of a still window [s].  limit: by how much motion may move the ZMP
    off the CoM [m].  sides: free or tied.  prior: the spread of people over the published one [1].  left_out: tasks or trials that
    are judged elsewhere, and calibrate only where `tasks` has them. Recordings of a subject follow one another, else PlumblineError.
    """
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in ("sesc", "chain", "poses", "guidance")}
    gate = Gate(window, limit)
    done = set[str]()
    for subject, group in groupby(recordings, key=lambda r: r.trial.subject):
        if subject in done:
            raise PlumblineError(f"the recordings of {subject} do not follow one another: sort them by subject")
        done.add(subject)
        who = people.get(subject, Participant(subject))
        found = [_trial(r, choose(markers, r.markers), who, masses.get(subject, math.nan), gate, sides == "tied") for r in group]
        trials = [t for t, _ in found if t is not None]
        one = person(subject, trials, tasks, prior, equations, left_out=left_out)
        if one is None:
            continue
        mine = {t.key["trial"] for t in one.trials}
        standing = next(b for t, b in found if t is not None and b is not None and t.key["trial"] in mine)
        tables["sesc"] += [_frames(one, t) for t in one.trials]
        tables["chain"].append(_chain(one))
        tables["poses"].append(_poses(one, trials, tasks, left_out))
        tables["guidance"].append(pd.DataFrame([_guidance(one, standing, sides == "tied")]))
    return {name: joined(name, frames) for name, frames in tables.items()}


def _trial(
    r: Recording, markerset: MarkerSet | None, who: Participant, mass: float, gate: Gate, tied: bool
) -> tuple[Trial | None, body.Body | None]:  # fmt: skip
    """Columns, windows and equations of one recording, None without a CoM from markers; and the person's standing figure."""
    if markerset is None or not r.markers:
        return None, None
    frame = body.build(r.markers, markerset, who.sex, r.time)
    if not known(frame.com()).any():
        return None, None
    standing = contact.of_feet(r.markers, support.feet(r.markers, markerset), r.time)
    weight = next((m for m in (mass, r.mass, who.mass or math.nan) if np.isfinite(m)), math.nan)
    force = forces.net(r.plates, r.time, standing)
    made, found = windows(frame, force, r.time, weight, gate, tied)
    moving = moving_rows(made, force, frame.angular_momentum(r.time, weight), r.time, weight)
    t = r.trial
    key = {"trial": t.trial, "subject": t.subject, "task": t.task, "condition": t.condition}
    return Trial(key, frozenset(names(t.trial, t.task, t.files)), r.time, made, found, moving), _upright(frame)


def _upright(frame: body.Body) -> body.Body:
    """The body in the frame in which its legs are straightest, limbs put straight: the person's figure for poses to come."""
    legs = [i for i, n in enumerate(frame.names) if n.startswith(("thigh", "shank"))] or list(range(len(frame.names)))
    u = frame.distal - frame.proximal
    u = u / np.linalg.norm(u, axis=2, keepdims=True)
    best = int(np.argmax(np.where(known(frame.com()), np.abs(u[:, legs, 2]).min(axis=1), -1.0)))
    one = slice(best, best + 1)
    return straight(body.Body(frame.names, frame.numbers, frame.proximal[one], frame.distal[one], np.zeros(1, bool), [], []))


# -- rows -------------------------------------------------------------------------------------------------------------


def told(cal: Calibration, c: Columns) -> tuple[Array, Array]:
    """CoM and its predicted sd in the frames of a trial [m], each (n, 3), with what no chain follows; NaN where nothing calibrates."""
    sd = np.hypot(spread(c.basis, cal.covariance), cal.noise.floor)
    return np.asarray(c.table + c.basis @ cal.mean) if cal.posterior.rows else np.full_like(c.table, np.nan), np.asarray(sd)


def _frames(one: Person, t: Trial) -> pd.DataFrame:
    used = one.calibration.directions
    com, sd = told(one.calibration, t.columns)
    by_others, _ = told(one.others[t.key["trial"]], t.columns)
    out = guidance.outside(t.columns.directions, used, REACH) if len(used) else np.ones(len(com), dtype=bool)
    xyz = {
        f"{name}_{a}": v[:, i]
        for name, v in (("com_sesc", com), ("com_sesc_sd", sd), ("com_others", by_others))
        for i, a in enumerate("xyz")
    }
    return pd.DataFrame({**t.key, "frame": np.arange(len(com)), **xyz, "outside": out})


def _chain(one: Person) -> pd.DataFrame:
    c = one.calibration
    before, after = np.sqrt(np.diag(c.posterior.prior.covariance))[: c.count], np.sqrt(np.diag(c.covariance))
    return pd.DataFrame(
        {
            "subject": one.subject, "parameter": [x.name for x in one.parameters], "unit": [x.unit for x in one.parameters],
            "value": c.mean, "sd": after, "prior_sd": before, "learnt": 1.0 - after / before,
        }
    )  # fmt: skip


def _poses(one: Person, trials: Sequence[Trial], tasks: Sequence[str], left_out: Sequence[str]) -> pd.DataFrame:
    rows = []
    alike = {t.key["trial"] for t in one.trials}
    for t in trials:
        chosen, trial = calibrates(t, tasks, left_out), t.key["trial"]
        judge = one.others[trial] if trial in one.blind and one.others[trial].posterior.rows else None
        for w in t.windows:
            reason = w.reason or ("" if chosen else "not among sesc.tasks" if tasks else "left out: evaluation.test")
            reason = reason if trial in alike else "other segments are seen than in the subject's other trials"
            by_others = w.table + w.basis @ judge.mean if judge is not None else np.full(3, np.nan)
            off, table = by_others[:2] - w.ground, w.table[:2] - w.ground
            rows.append(
                t.key | {
                    "time": w.middle, "length": w.length, "still": not w.reason, "used": not reason, "reason": reason,
                    "load": w.load, "shift": w.shift,
                    "ground_x": w.ground[0], "ground_y": w.ground[1], "table_error_x": table[0], "table_error_y": table[1],
                    "sesc_error_x": off[0], "sesc_error_y": off[1],
                }
            )  # fmt: skip
    return pd.DataFrame(rows)


def _guidance(one: Person, standing: body.Body, tied: bool) -> dict[str, Any]:
    """What is known of the CoM over what the subject does, whether the vertical is, and the poses to record next."""
    c = one.calibration
    p, noise = c.posterior, c.noise
    motion, ways = (np.concatenate([v(t.columns)[known(t.columns.table)] for t in one.trials]) for v in (_basis, _directions))
    pick = np.unique(np.linspace(0, len(motion) - 1, FRAMES).astype(int))
    motion, ways = motion[pick], ways[pick]
    prior = p.prior.covariance[: c.count, : c.count]
    before, now = guidance.mean_spread(motion, prior), np.hypot(guidance.mean_spread(motion, c.covariance), noise.floor)
    rests = guidance.rests_on_prior(c.rows.matrix, prior, motion) if p.rows else guidance.WIDER
    steps = list(_next(c.covariance, motion, standing, noise, tied))
    out: dict[str, Any] = {"subject": one.subject, "windows": len(c.directions), "misfit": p.misfit, "floor": noise.floor}
    for i, a in enumerate("xyz"):
        out |= {f"table_sd_{a}": before[i], f"sd_{a}": now[i]}
    out["outside"] = float(np.mean(guidance.outside(ways, c.directions, REACH))) if len(c.directions) else 1.0
    out |= {"vertical_rests": rests, "vertical_observable": rests < guidance.RESTS}
    gains = [float(g) for g in p.gains if g > 0.01]
    out |= {"learnt": int(np.sum(p.gains > 1.0)), "parameters": len(c.mean), "gains": json.dumps([round(g, 2) for g in gains])}
    out |= {"next": json.dumps([{"pose": s.pose, "sd": [round(float(v), 5) for v in s.sd]} for s in steps])}
    return out


def _basis(c: Columns) -> Array:
    return c.basis


def _directions(c: Columns) -> Array:
    return c.directions


def _next(covariance: Array, motion: Array, standing: body.Body, noise: Noise, tied: bool) -> Iterator[guidance.Step]:
    """The poses to record next, one after the other in one recording, each held for `HOLD`.  covariance: of the parameters (q, q)."""
    candidates = {name: np.hstack([columns(posed(standing, name), tied).basis[0, :2], np.eye(2)]) for name in POSES}
    padded = np.concatenate([motion, np.zeros((len(motion), 3, 2))], axis=2)
    unknown = block_diag(covariance, noise.constant**2 * np.eye(2))
    yield from guidance.next_poses(unknown, padded, candidates, hold_sd(noise), NEXT)


def hold_sd(noise: Noise, seconds: float = HOLD, rate: float = 100.0) -> float:
    """sd of the mean of a held pose [m], without the CoP's constant error."""
    return float(np.sqrt(mean_covariance(np.zeros(1), seconds, round(seconds * rate), noise)[0, 0] + noise.floor**2))
