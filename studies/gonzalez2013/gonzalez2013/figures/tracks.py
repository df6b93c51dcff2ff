"""Fig. 3: CoM over time, true, by the segment table and calibrated, with the band that the calibration predicts."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from plumbline.figures import _style as s

AXES = {"y": "forward", "x": "to the right", "z": "up"}  # the paper's order
TITLES = {"volume": "Held-out volume, 60 s", "sts": "Standing up from a seat, 2 s"}
BAND = "#cfe1f0"
LEAST = 20.0  # [mm] an axis that hardly moves is not blown up


@s.styled
def draw(tracks: pd.DataFrame) -> Figure:
    """Three axes for each motion, mm from the true CoM's mean.  tracks: table of that name."""
    page = s.page(5.4)
    panels = page.subplots(3, 2, sharex="col")
    for column, (task, title) in enumerate(TITLES.items()):
        mine = tracks[tracks["task"] == task]
        for row, axis in enumerate(AXES):
            _panel(panels[row, column], mine, axis)
        panels[0, column].set_title(title)
        panels[2, column].set_xlabel("time [s]")
    for row, words in enumerate(AXES.values()):
        panels[row, 0].set_ylabel(f"CoM {words} [mm]")
    keys = [
        Line2D([], [], color=s.MEASURED, lw=1.2, label="true"),
        Line2D([], [], color=s.MEASURED_TOO, lw=1.0, label="segment table"),
        Line2D([], [], color=s.MODEL, lw=1.2, label="calibrated on 300 s"),
        Patch(color=BAND, label="its predicted band of 95 %"),
    ]
    page.legend(handles=keys, loc="outside upper left", ncols=4, columnspacing=1.6)
    return page


def _panel(axes: Axes, mine: pd.DataFrame, axis: str) -> None:
    time = mine["time"].to_numpy(float)
    true, table, own, sd = (mine[f"{k}_{axis}"].to_numpy(float) for k in ("true", "table", "own", "sd"))
    zero = true.mean()
    low, high = 1e3 * (own - 1.96 * sd - zero), 1e3 * (own + 1.96 * sd - zero)
    every = max(len(time) // 600, 1)
    axes.fill_between(time[::every], low[::every], high[::every], color=BAND, lw=0, zorder=1)
    s.line(axes, time, 1e3 * (table - zero), s.MEASURED_TOO, width=1.0)
    s.line(axes, time, 1e3 * (own - zero), s.MODEL, width=1.2)
    s.line(axes, time, 1e3 * (true - zero), s.MEASURED, width=0.9)
    words = [f"rms error {1e3 * np.sqrt(np.mean((v - true) ** 2)):.1f} mm" for v in (table, own)]
    axes.margins(x=0.01, y=0.16)
    bottom, top = axes.get_ylim()
    short = max(LEAST - (top - bottom), 0.0) / 2
    axes.set_ylim(bottom - short, top + short)
    axes.text(0.02, 0.97, f"table: {words[0]}", transform=axes.transAxes, va="top", color="#6a6a6a", fontsize=7)
    axes.text(0.98, 0.97, f"calibrated: {words[1]}", transform=axes.transAxes, va="top", ha="right", color=s.MODEL, fontsize=7)
