r"""Trust regions: where along each locus a law holds, and the switching points between them; tables `trust` and `rls`.

Two ways side by side. The switching points that other stages use are change points (`switching`). Beside them stands the rule of Murai
2013 made numeric: recursive least squares runs forward along a locus and returns from its end; where the returning
estimate begins to stray the other law has begun. "Stray" is the law's innovation, averaged over AVERAGE, in standard deviations that
hold the noise pooled over all loci and a covariance inflated by the noise's correlation:

.. math:: z_k = \frac{\overline{p_k - \varphi_k \hat\theta_{k+g}}}{s\,\sqrt{1 + 2 \tau f\, \varphi_k S_{k+g}^{-1} \varphi_k^T}}

For a locus that begins inside the limits and leaves (falling) the order is reversed. The passes shown are the paper's (returning from
theta_F[N] with P0 reset large). The passes that decide start from the group's law with a narrow prior instead: from a single locus the
three parameters are known too badly near its quiet end, and before a fall the law is seen for some hundredths of a second. The rule
gives one switch per locus at most, and none where the law never asks for three standard deviations more than the limit gives.
"""

import json
import warnings
from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import law as laws
from plumbline import rls, tables
from plumbline.batch import Batch
from plumbline.clusters import group_windows, plant_of
from plumbline.groups import Group, Key, of_loci
from plumbline.models.controller import Law
from plumbline.plant import SIGNALS, rows_of
from plumbline.switching import Noise, Regime

Array = NDArray[np.float64]

COLUMNS = [*SIGNALS, "com_lp_x", "com_ddot_x", "zmp_lp_x"]
"""Columns of `signals` that this stage reads."""

AVERAGE = 0.04  # [s] over which the innovation is averaged
GAP = 0.02  # [s] between an estimate and the frame it is to judge
VARIES = 0.1  # share by which the gains of one locus may leave those of the group, and
DRIFTS = 5e-3  # [m] by which its reference may
STRAYS = 3.0  # standard deviations
CALM = 1.0  # the stray began where the statistic was last below this
FILTER_TIME = 0.1  # [s] over which the low-passed signals hang together
NAMES = np.array(["left", "inside", "right"])


def of_part(
    signals: pd.DataFrame,
    pushes: pd.DataFrame,
    loci: pd.DataFrame,
    coverage: pd.DataFrame,
    trials: pd.DataFrame,
    evaluation: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `trust` and `rls` of whole subjects.

    trials: for the `switch` events of each file.  evaluation: half_width and exponent of the test functions behind omega.  Loci whose
    group has no omega or whose gains cannot be told have no rows here; `clusters` says why.
    """
    marks = {t.trial: [e[0] for e in json.loads(str(t.events) or "[]") if e[2] == "switch"] for t in trials.itertuples()}
    of_group = group_windows(signals, pushes, loci, coverage, evaluation)
    plants = {key: plant_of(weak) for key, weak in of_group.items()}
    omega = {key: plant.omega for key, plant in plants.items() if plant is not None and plant.w2 > 0}
    parts, traces = [], []
    for group in of_loci(signals, pushes, loci, omega):
        key = Key(group.subject, group.task, group.condition)
        found = laws.regimes(group.batch, omega[key], group.steady)
        if found is None:
            continue
        passes = Passes.of(group.batch, found.saturation.law, found.noise, group.loci["kind"].to_numpy() == "falling")
        for j in range(len(group.loci)):
            locus = group.loci.iloc[j]
            parts += _parts(group, j, found.regime, passes.switch[j], marks.get(locus["trial"], []))
        plant = plants[key]
        traces.append(_traces(group, passes, signals, plant.constant / plant.w2 if plant else 0.0))
    table = pd.DataFrame(parts)[[c.name for c in tables.TABLES["trust"]]] if parts else tables.empty("trust")
    return table, tables.joined("rls", traces)


# -- regimes ----------------------------------------------------------------------------------------------------------


def _parts(group: Group, j: int, regime: Regime, by_rls: float, marks: Sequence[float]) -> list[dict[str, Any]]:
    """Rows of `trust` for one locus; marks: instants of its trial that a person called a switch [s]."""
    locus, batch = group.loci.iloc[j], group.batch
    rows = regime[batch.lead : batch.end[j], j]
    last = group.starts[j] + (len(rows) - 1) / batch.rate
    found = group.starts[j] + (np.flatnonzero(np.diff(rows)) + 0.5) / batch.rate
    names = NAMES[rows[np.concatenate([[0], np.flatnonzero(np.diff(rows)) + 1])] + 1]
    within = [m for m in marks if locus["start"] <= m <= locus["end"]]
    mark = _marks(found, within)
    if lost := sorted(set(within) - set(mark)):
        said = ", ".join(f"{m:.3f}" for m in lost)
        warnings.warn(f"{locus['trial']}, locus {locus['locus']}: no switch was found for the mark at {said} s", stacklevel=2)
    begin = np.concatenate([[group.starts[j]], np.where(np.isfinite(mark), mark, found)])
    begin = np.maximum.accumulate(begin)
    end = np.concatenate([begin[1:], [last]])
    rate = (locus["end_frame"] - locus["start_frame"]) / (locus["end"] - locus["start"])
    frame = locus["start_frame"] + np.ceil((begin - locus["start"]) * rate - 1e-6).astype(int)
    stop = locus["start_frame"] + np.ceil((end - locus["start"]) * rate - 1e-6).astype(int) - 1
    stop[-1] = locus["start_frame"] + round((last - locus["start"]) * rate)
    nearest = int(np.argmin(np.abs(found - (group.starts[j] + by_rls)))) + 1 if len(found) and np.isfinite(by_rls) else -1
    nan = float("nan")
    return [
        {k: locus[k] for k in ("trial", "subject", "task", "condition", "locus")}
        | {
            "part": i + 1, "regime": str(names[i]), "start": float(begin[i]), "end": float(end[i]),
            "start_frame": int(frame[i]), "end_frame": int(max(stop[i], frame[i])),
            "source": "start" if i == 0 else "event" if np.isfinite(mark[i - 1]) else "found",
            "found": float(found[i - 1]) if i else nan, "rls": group.starts[j] + by_rls if i == nearest else nan,
            "mark": float(mark[i - 1]) if i else nan, "mark_distance": float(found[i - 1] - mark[i - 1]) if i else nan,
        }
        for i in range(len(names))
    ]  # fmt: skip


def _marks(found: Array, marks: Sequence[float]) -> Array:
    """The person's mark of each switch found [s], NaN where none, in the order of time and as near as that allows.

    Every switch takes at most one mark; of more marks than switches the farthest are left over.
    """
    given = np.sort(np.asarray(marks, dtype=float))
    if len(given) > len(found):
        nearest = np.abs(given[:, None] - found).min(1) if len(found) else np.zeros(len(given))
        given = np.sort(given[np.argsort(nearest, kind="stable")[: len(found)]])
    out = np.full(len(found), np.nan)
    best: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]  # cheapest way to give the first k marks, switches in ascending order
    for mark in given:
        best = [
            min((cost + abs(float(found[j]) - float(mark)), (*used, j)) for cost, used in best if not used or j > used[-1])
            for j in range(len(found))
            if any(not used or j > used[-1] for _, used in best)
        ]
    if len(given):
        out[list(min(best)[1])] = given
    return out


# -- returning RLS ----------------------------------------------------------------------------------------------------


class Passes(NamedTuple):
    """Forward and backward RLS of the law over a batch, rows from each locus' start.

    switch: switching point by the rule, from the locus' start [s], NaN where the pass never strays; shape (m,).
    """

    forward: rls.Trace
    backward: rls.Trace
    deviation: Array
    stray: Array
    switch: Array

    @classmethod
    def of(cls, batch: Batch, law: Law, noise: Noise, falling: NDArray[np.bool_]) -> "Passes":
        """Run both passes of p on (1, x, x').

        falling: (m,) loci whose order is reversed. The passes shown are the paper's. The passes that look for the switch start from the
        group's law and may leave it by what loci of one person differ: the law is seen for some hundredths of a second before a fall.
        """
        x, v, p = (a[batch.lead :] for a in (batch.x, batch.v, batch.p))
        length = batch.end - batch.lead
        phi = [np.ones_like(x), x, v]
        forward, backward = rls.returning(p, phi, length=length)
        inflation = 1 + 2 * noise.time * batch.rate  # samples of correlated noise that weigh as one
        start = np.array([(1 - law.k1) * law.d, law.k1, law.k2])
        spread = np.array([DRIFTS, VARIES * law.k1, VARIES * law.k2])
        p0 = (spread / noise.inside) ** 2 / inflation
        gap = round(GAP * batch.rate)
        there = _stray(p, phi, rls.forward(p, phi, p0=p0, theta0=start, length=length), noise.inside, inflation, -gap)
        back = _stray(p, phi, rls.backward(p, phi, p0=p0, theta0=start, length=length), noise.inside, inflation, gap)
        stray = np.where(falling, there, back)
        switch = [_onset(stray[: length[j], j], batch.rate, from_end=not falling[j]) for j in range(len(length))]
        return cls(forward, backward, rls.deviation(backward, noise.inside * np.sqrt(inflation)), stray, np.array(switch))


def _stray(p: Array, phi: Sequence[Array], trace: rls.Trace, sd: float, inflation: float, step: int) -> Array:
    """Innovation of each frame against the estimate `step` frames later (the pass runs backwards) or earlier (step < 0).

    In its standard deviations, (n, m); NaN without an estimate. An estimate with a gap does not yet hold the frames it is to judge.
    """
    theta, information = (_shifted(a, step) for a in (trace.theta, trace.information))
    error = p - sum(a * b for a, b in zip(phi, theta, strict=True))
    known = np.isfinite(theta[0])
    column = np.stack([np.broadcast_to(a, p.shape)[known] for a in phi], axis=1)
    full = np.empty((len(column), len(phi), len(phi)))
    for k, (i, j) in enumerate(combinations_with_replacement(range(len(phi)), 2)):
        full[:, i, j] = full[:, j, i] = information[k][known]
    leverage = np.einsum("ni,ni->n", column, np.linalg.solve(full, column[..., None])[..., 0])
    out = np.full(p.shape, np.nan)
    out[known] = error[known] / (sd * np.sqrt(1 + inflation * np.maximum(leverage, 0.0)))
    return out


def _shifted(a: Array, step: int) -> Array:
    """Row k + step in place of row k; a pass that runs forwards has its first row before it began, NaN at the far end else."""
    if step < 0:
        return np.concatenate([a[:, :1].repeat(-step, 1), a[:, :step]], axis=1)
    return np.concatenate([a[:, step:], np.full_like(a[:, :step], np.nan)], axis=1)


def _onset(stray: Array, rate: float, *, from_end: bool) -> float:
    """Instant from the locus' start [s] at which a pass begins to stray; NaN where it never does.

    stray: (n,) in the order of time.  Averaged over AVERAGE of what the pass meets next.
    """
    z = stray[::-1] if from_end else stray
    width = max(1, round(AVERAGE * rate))
    if np.isfinite(z).sum() <= width:
        return float("nan")
    first = int(np.argmax(np.isfinite(z)))
    mean = np.convolve(z[first:], np.full(width, 1 / width), mode="valid")
    far = np.flatnonzero(np.abs(mean) > STRAYS)
    if not len(far):
        return float("nan")
    calm = np.flatnonzero(np.abs(z[first : first + far[0] + 1]) < CALM)
    at = first + (int(calm[-1]) + 1 if len(calm) else 0)
    return float((len(z) - at if from_end else at) - 0.5) / rate


def _traces(group: Group, passes: Passes, signals: pd.DataFrame, offset: float) -> pd.DataFrame:
    """Rows of `rls` of a group.

    omega comes from x'' = w2 (x - p - offset) on the low-passed signals, as in the paper; the gains from p on (1, x, x'), not filtered.
    """
    rate, length = group.batch.rate, group.batch.end - group.batch.lead
    acceleration, lever = _filtered(group, signals, offset)
    forward, backward = rls.returning(acceleration, [lever], length=length)
    scatter = np.nanmedian(np.abs(acceleration - lever * backward.theta[0][0])) / 0.6745
    sd = rls.deviation(backward, float(scatter) * np.sqrt(2 * FILTER_TIME * rate))[0]
    w = [np.sqrt(np.where(one.theta[0] > 0, one.theta[0], np.nan)) for one in (forward, backward)]
    pieces = []
    for j in range(len(length)):
        locus, n = group.loci.iloc[j], int(length[j])
        time = group.starts[j] + np.arange(n) / rate
        ratio = (locus["end_frame"] - locus["start_frame"]) / (locus["end"] - locus["start"])
        columns = {"omega_forward": w[0][:n, j], "omega_backward": w[1][:n, j]}
        with np.errstate(divide="ignore", invalid="ignore"):
            columns["omega_sd"] = sd[:n, j] / (2 * w[1][:n, j])
        for k, name in ((1, "k1"), (2, "k2")):
            columns[f"{name}_forward"] = passes.forward.theta[k, :n, j]
            columns[f"{name}_backward"] = passes.backward.theta[k, :n, j]
            columns[f"{name}_sd"] = passes.deviation[k, :n, j]
        about = {"trial": locus["trial"], "subject": locus["subject"], "locus": locus["locus"]}
        frame = locus["start_frame"] + np.rint((time - locus["start"]) * ratio).astype(int)
        pieces.append(pd.DataFrame(about | {"frame": frame, "time": time} | columns | {"stray": passes.stray[:n, j]}))
    return pd.concat(pieces, ignore_index=True)


def _filtered(group: Group, signals: pd.DataFrame, offset: float) -> tuple[Array, Array]:
    """Low-passed x'' [m/s2] and x - p - offset [m] on the rows of a group's loci, (n, m); 0 where unknown, which weighs nothing."""
    batch = group.batch
    length = batch.end - batch.lead
    out = np.zeros((2, len(batch.x) - batch.lead, len(length)))
    rows = signals.groupby("trial", sort=False, observed=True).indices
    for j, trial in enumerate(group.loci["trial"]):
        table = rows_of(signals, rows[trial])
        time = group.starts[j] + np.arange(length[j]) / batch.rate
        a = np.interp(time, table["time"], table["com_ddot_x"])
        lever = np.interp(time, table["time"], table["com_lp_x"] - table["zmp_lp_x"]) - offset
        good = np.isfinite(a + lever)
        out[:, : length[j], j] = np.where(good, [a, lever], 0.0)
    return out[0], out[1]
