"""Extrapolated CoM, margin of stability and missing step of every frame, with the subject's own omega.

Formulas: ``plumbline/models/stability.py``. Each CoM that markers or the file give is followed beside the others, so that one sees what
a personal CoM changes: its height sets omega = sqrt(g/z), and too low a CoM makes every margin too large. The borders are those of
``plumbline/support.py``: to the right and left, to the front and back. A hand or a seat widens the support, and no margin here knows it.
"""

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.models import stability as model
from plumbline.tables import joined

Array = NDArray[np.float64]

METHODS: Mapping[str, str] = {"table": "com_table", "lab": "com_lab", "sesc": "com_sesc"}
"""CoM -> its columns in `signals`."""
BORDERS = {"x": ("limit_left", "limit_right"), "y": ("limit_back", "limit_front")}
HALF = 0.06  # [s] to each side over which a speed is taken: 1 mm of noise at 100 Hz becomes 8 mm/s, and 2.5 mm of extrapolated CoM
KEY = ("trial", "subject", "task", "condition")


def stability(signals: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Tables `stability` (frames) and `margins` (trials) of a part, by name."""
    frames, trials = list[pd.DataFrame](), list[pd.DataFrame]()
    for key, rows in signals.groupby(list(KEY), observed=True, sort=True):
        for one in _trial(rows.sort_values("frame")):
            about = dict(zip(KEY, map(str, key), strict=True))
            frames.append(one.assign(**about))
            trials.append(pd.DataFrame([about | _summary(one)]))
    return {"stability": joined("stability", frames), "margins": joined("margins", trials)}


def _trial(rows: pd.DataFrame) -> Iterator[pd.DataFrame]:
    time = rows["time"].to_numpy(float)
    for method, name in METHODS.items():
        com = rows[[f"{name}_{a}" for a in "xyz"]].to_numpy(float)
        omega = model.natural(com[:, 2] - rows["zmp_z"].to_numpy(float))
        if not np.isfinite(omega).any():
            continue
        out = {"method": method, "frame": rows["frame"].to_numpy(), "omega": omega}
        for i, (axis, (low, high)) in enumerate(BORDERS.items()):
            xi = model.extrapolated(com[:, i], model.speed(com[:, i], time, HALF), omega)
            borders = rows[low].to_numpy(float), rows[high].to_numpy(float)
            out |= {f"xcom_{axis}": xi, f"margin_{axis}": model.margin(xi, *borders), f"step_{axis}": model.step(xi, *borders)}
        yield pd.DataFrame(out)


def _summary(frames: pd.DataFrame) -> dict[str, object]:
    """A trial in one line; NaN where no border is known."""
    out: dict[str, object] = {"method": frames["method"].iloc[0], "omega": float(frames["omega"].mean())}
    for axis in BORDERS:
        margin = frames[f"margin_{axis}"].dropna()
        out |= {f"least_{axis}": margin.min(), f"mean_{axis}": margin.mean()}
        out |= {f"outside_{axis}": (margin < 0).mean(), f"step_{axis}": frames[f"step_{axis}"].abs().max()}
    return out
