r"""The CoM methods side by side, ranked per subject by what they must obey: Newton in motion, the gravity line at rest.

In motion :math:`r = m\ddot x - F_x` (and the same forward and up) in the weak form; at rest the distance from the ground projection of
still windows. A subject's own CoM (``sesc``) is judged as its *other* trials tell it. Methods made from the force obey it by
construction: their residual is shown, and not ranked. A delay of the force record behind the markers, as the vertical tells it, is
undone first for what the markers make; a constant is taken off in each trial, as the shear of plates has a zero error.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.filters import known
from plumbline.moving import STRIDE, earlier, late_by
from plumbline.physics import G
from plumbline.still import LOAD
from plumbline.tables import TABLES
from plumbline.weak import Bump

Array = NDArray[np.float64]

METHODS: Mapping[str, str] = {"table": "com_table", "lab": "com_lab", "sesc": "com_others", "force": "com_force", "fused": "com_fused"}
"""method -> its columns in `signals`; the subject's own is the one told by other trials."""
FROM_FORCE = ("force", "fused")


def centres(
    signals: pd.DataFrame, coverage: pd.DataFrame, poses: pd.DataFrame, *, half_width: float, exponent: int, tasks: Sequence[str] = ()
) -> pd.DataFrame:  # fmt: skip
    """Table `centres` of a part.

    half_width: of the bump [s].  tasks: tasks or trials that calibrate the own CoM; where given, the others alone are judged, for all
    methods, if there are any. Windows in which the vertical lacks more than 2 % of body weight are left out: something touches the
    person there.
    """
    rows = [
        row
        for subject, trials in signals.groupby("subject", observed=True, sort=True)
        for row in _subject(str(subject), _blind(trials, tasks), coverage, poses[poses["subject"] == subject], half_width, exponent)
    ]
    return pd.DataFrame(rows, columns=[c.name for c in TABLES["centres"]])


def _blind(signals: pd.DataFrame, tasks: Sequence[str]) -> pd.DataFrame:
    """Trials that the own CoM has not seen; all where there are no others."""
    rest = signals[~(signals["task"].isin(tasks) | signals["trial"].isin(tasks))]
    return rest if len(rest) else signals


def _subject(
    subject: str, signals: pd.DataFrame, coverage: pd.DataFrame, poses: pd.DataFrame, half_width: float, exponent: int
) -> Iterator[dict[str, Any]]:  # fmt: skip
    mass = {str(r["trial"]): float(r["mass"]) for _, r in coverage.iterrows()}
    trials = [(str(t), rows.sort_values("frame")) for t, rows in signals.groupby("trial", observed=True, sort=True)]
    each = [_residuals(rows, mass.get(t, np.nan), half_width, exponent) for t, rows in trials]
    left = {m: np.concatenate([e[m] for e in each]) for m in METHODS}
    off = {m: _at_rest(trials, poses, c) for m, c in METHODS.items()}
    moving, still = ({m: _rms(v[m]) for m in METHODS} for v in (left, off))
    rank, rank_still = _ranks(moving, left), _ranks(still, off)
    for method in METHODS:
        if len(left[method]) or len(off[method]):
            yield {
                "subject": subject, "method": method, "windows": len(left[method]), "poses": len(off[method]),
                **{f"r_force_{a}": v for a, v in zip("xyz", moving[method], strict=True)},
                **{f"static_{a}": v for a, v in zip("xy", still[method], strict=True)},
                "rank": rank.get(method, 0), "rank_still": rank_still.get(method, 0), "note": _note(method, left, off),
            }  # fmt: skip


def _ranks(size: Mapping[str, Array], seen: Mapping[str, Array]) -> dict[str, int]:
    """Place of each method that was judged on as much as any; those made from the force have none."""
    most = max(len(seen[m]) for m in METHODS if m not in FROM_FORCE)
    fair = {m: float(np.linalg.norm(size[m])) for m in METHODS if m not in FROM_FORCE and len(seen[m]) == most > 0}
    return {m: k for k, m in enumerate(sorted(fair, key=lambda m: fair[m]), 1)}


def _note(method: str, left: Mapping[str, Array], off: Mapping[str, Array]) -> str:
    if method in FROM_FORCE:
        return "made from the force: its residual says nothing"
    fewer = any(len(v[method]) < max(len(v[m]) for m in METHODS if m not in FROM_FORCE) for v in (left, off))
    return "judged on fewer windows than another: not ranked there" if fewer else ""


def _residuals(rows: pd.DataFrame, mass: float, half_width: float, exponent: int) -> dict[str, Array]:
    """x'' - F/m of the windows of a trial by method [m/s2], (k, 3), the same windows for all that have a CoM there."""
    time, grf = rows["time"].to_numpy(), rows[[f"grf_{a}" for a in "xyz"]].to_numpy()
    rate = (len(time) - 1) / float(np.ptp(time)) if len(time) > 1 else 0.0
    if half_width * rate < 4 or not np.isfinite(mass):
        return {m: np.zeros((0, 3)) for m in METHODS}
    b = Bump(half_width, exponent, rate)
    com = {m: rows[[f"{c}_{a}" for a in "xyz"]].to_numpy() for m, c in METHODS.items()}
    z = next((com[m][:, 2] for m in ("table", "lab") if known(com[m]).any()), np.full(len(time), np.nan))
    pull = grf / mass
    made = b.mean(pull), b.mean(earlier(pull, late_by(b, pull[:, 2], z, rate) * rate))
    fixed = {m: np.array([0.0, 0.0, G]) - made[m not in FROM_FORCE] for m in METHODS}
    r = {m: b.second(v) + fixed[m] for m, v in com.items()}
    whole = [m for m in METHODS if m not in FROM_FORCE and known(r[m]).any()]
    good = np.logical_and.reduce([known(r[m]) for m in whole]) if whole else np.zeros(len(time), dtype=bool)
    if whole:  # a contact that no plate measured is nobody's fault
        good &= ~(np.abs(r[whole[0]][:, 2]) > LOAD * G)
    picked = np.flatnonzero(good)[:: max(round(half_width * rate * STRIDE), 1)]
    kept = {m: v[picked][known(v[picked])] for m, v in r.items()}
    return {m: v - v.mean(axis=0) if len(v) else v for m, v in kept.items()}


def _at_rest(trials: list[tuple[str, pd.DataFrame]], poses: pd.DataFrame, name: str) -> Array:
    """CoM less ground projection of the still windows [m], (k, 2)."""
    out = []
    for trial, rows in trials:
        mine = poses[(poses["trial"] == trial) & poses["still"]]
        time, com = rows["time"].to_numpy(), rows[[f"{name}_x", f"{name}_y"]].to_numpy()
        for at, length, x, y in mine[["time", "length", "ground_x", "ground_y"]].to_numpy():
            inside = com[np.abs(time - at) <= length / 2]
            if len(inside) and np.isfinite(inside).all():
                out.append(inside.mean(axis=0) - (x, y))
    return np.array(out).reshape(-1, 2)


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0))) if len(values) else np.full(values.shape[1], np.nan)
