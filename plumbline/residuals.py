"""Where the model fails: residuals frame by frame, and their maps over phase plane, time, trial and frequency."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.fit import Windows, free_runs, windows
from plumbline.models.com_zmp import com_acceleration, zmp_error

Array = NDArray[np.float64]

PHASE_BIN = (0.01, 0.05)  # [m], [m/s]
TIME_BIN = 0.1  # [s]
SEGMENT = 2.0  # [s] of a spectrum; bins of 0.5 Hz


def residuals(
    signals: pd.DataFrame, pushes: pd.DataFrame, loci: pd.DataFrame, coverage: pd.DataFrame, heldout: pd.DataFrame,
    evaluation: Mapping[str, Any],
) -> tuple[pd.DataFrame, pd.DataFrame]:  # fmt: skip
    """Tables `residuals` and `where` of a part.

    Every trial is seen with the w2 that was found without it (table `heldout`); trials that no fold judged are left out there
    and here alike.
    """
    known = {(r["trial"], r["axis"]): (float(r["w2"]), float(r["offset"])) for _, r in heldout.iterrows()}
    frames: list[pd.DataFrame] = []
    maps: list[pd.DataFrame] = []
    for w in windows(signals, pushes, loci, coverage, evaluation):
        if (w.trial, w.axis) in known:
            one = of_trial(w, *known[w.trial, w.axis])
            frames.append(one)
            maps += list(_maps(one, w.plant.rate))
    where = pd.concat(maps, ignore_index=True) if maps else pd.DataFrame()
    return (pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()), _pool(where)


def of_trial(w: Windows, w2: float, offset: float) -> pd.DataFrame:
    """Residuals of one trial and axis, one row per frame."""
    p = w.plant
    since = w.time.copy()
    for locus in np.unique(w.locus):
        inside = w.locus == locus
        since[inside] = since[inside] - since[inside][0] if locus else np.nan
    return pd.DataFrame(
        {
            "trial": w.trial, "subject": w.subject, "task": w.task, "condition": w.condition, "axis": w.axis,
            "frame": np.arange(len(w.time)), "time": w.time, "locus": w.locus, "since": since,
            "com": p.mean_x, "velocity": p.velocity, "acceleration": p.acceleration,
            "acceleration_model": com_acceleration(p.mean_x, p.mean_p + offset, w2),
            "zmp": p.mean_p, "zmp_model": p.mean_x - p.acceleration / w2 - offset,
            "r_plant": p.acceleration - com_acceleration(p.mean_x, p.mean_p + offset, w2),
            "error": zmp_error(p.acceleration, p.lever, w2) - offset,
            "r_force": p.force, "r_vertical": p.vertical,
            "com_measured": p.x, "com_free": free_runs(p, w2, offset),
        }
    )  # fmt: skip


# -- maps: sums per bin, so that parts add up ---------------------------------------------------------------------------


def _maps(one: pd.DataFrame, rate: float) -> Iterator[pd.DataFrame]:
    used = one[np.isfinite(one["error"])]
    if used.empty:
        return
    reference = float(np.median(used["com"]))
    a = _bin(used["com"].to_numpy() - reference, PHASE_BIN[0])
    b = _bin(used["velocity"].to_numpy(), PHASE_BIN[1])
    yield _view(used, "phase", a, b)
    late = used[np.isfinite(used["since"])]
    yield _view(late, "time", _bin(late["since"].to_numpy(), TIME_BIN), np.zeros(len(late)))
    yield _view(used, "trial", np.zeros(len(used)), np.zeros(len(used)), trial=str(used["trial"].iloc[0]))
    yield _spectrum(one, rate)


def _bin(values: Array, width: float) -> Array:
    return np.asarray(np.round(np.floor(values / width) * width + width / 2, 9))


def _view(used: pd.DataFrame, view: str, a: Array, b: Array, trial: str = "") -> pd.DataFrame:
    out = used[["subject", "task", "condition", "axis"]].assign(view=view, trial=trial, a=a, b=b, count=1)
    return out.assign(sum=used["error"], square_sum=used["error"] ** 2)


def _spectrum(one: pd.DataFrame, rate: float) -> pd.DataFrame:
    """Power density of the error, one row per segment and frequency."""
    error, length = one["error"].to_numpy(), round(SEGMENT * rate)
    good = np.isfinite(error)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.view(np.int8), [0]])))
    rows = [
        _density(error[start + k * length :][:length], rate)
        for start, end in zip(edges[::2], edges[1::2], strict=True)
        for k in range((end - start) // length)
    ]
    table = pd.concat(rows) if rows else pd.DataFrame({"a": [], "square_sum": []}, dtype=float)
    first = one.iloc[0]
    same = {k: first[k] for k in ("subject", "task", "condition", "axis")}
    return table.assign(**same, view="frequency", trial="", b=0.0, count=1, sum=0.0)


def _density(segment: Array, rate: float) -> pd.DataFrame:
    """One-sided power density [m2/Hz] of a segment, its mean taken off, under a Hann window; up to 10 Hz."""
    window = np.hanning(len(segment) + 1)[:-1]
    f = np.fft.rfftfreq(len(segment), 1 / rate)
    density = 2 * np.abs(np.fft.rfft(window * (segment - segment.mean()))) ** 2 / (rate * np.sum(window**2))
    keep = (f > 0) & (f <= min(10.0, 0.49 * rate))
    return pd.DataFrame({"a": np.round(f[keep], 6), "square_sum": density[keep]})


def _pool(where: pd.DataFrame) -> pd.DataFrame:
    keys = ["subject", "task", "condition", "axis", "view", "trial", "a", "b"]
    return where.groupby(keys, as_index=False, sort=True)[["count", "sum", "square_sum"]].sum() if len(where) else where
