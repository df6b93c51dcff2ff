"""Measured against modelled, one trial per subject, with what is left between them."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from plumbline.figures import _style as s

MOST = 4  # subjects on a page
LONGEST = 30.0  # [s] of a trial that are drawn


@s.styled
def draw(residuals: pd.DataFrame) -> Figure:
    """A block per subject (of one subject: both axes).  residuals: table of a part.

    Drawn is each subject's median trial by rms error on the axis of the first block: neither the best nor the worst.
    """
    judged = residuals[np.isfinite(residuals["error"])]
    if judged.empty:
        return s.empty("Measured and modelled", "no trial could be left out and judged: see the first lines of the report")
    blocks, left_out = choose(judged)
    figure = s.page(0.4 + 4.4 * len(blocks))
    grid = figure.add_gridspec(len(blocks), 2, width_ratios=[2.1, 1])
    for row, block in enumerate(blocks):
        rows = residuals[(residuals["trial"] == block.trial) & (residuals["axis"] == block.axis)]
        left, right = grid[row, 0].subgridspec(5, 1, height_ratios=[1.5, 0.8, 1.5, 0.8, 1.2]), grid[row, 1].subgridspec(2, 1)
        _block(np.asarray(left.subplots(sharex=True)), np.asarray(right.subplots()), rows.sort_values("frame"), block)
    s.footnote(figure, s.not_drawn(left_out, "results/residuals"))
    return figure


class Block(NamedTuple):
    """What one block shows: trial, axis, how many trials it is the median of, and on which axis."""

    trial: str
    axis: str
    of: int
    ranked: str


def choose(judged: pd.DataFrame) -> tuple[list[Block], list[str]]:
    """Blocks to draw and the subjects left out.  judged: rows of `residuals` with an error."""
    subjects = sorted(judged["subject"].unique())
    out: list[Block] = []
    for subject in subjects[:MOST]:
        mine = judged[judged["subject"] == subject]
        axes = [a for a in s.LETTER if (mine["axis"] == a).any()]
        trial, count = median_trial(mine[mine["axis"] == axes[0]])
        drawn = [a for a in axes if ((mine["axis"] == a) & (mine["trial"] == trial)).any()]
        out += [Block(trial, axis, count, axes[0]) for axis in (drawn if len(subjects) == 1 else drawn[:1])]
    return out, subjects[MOST:]


def median_trial(judged: pd.DataFrame) -> tuple[str, int]:
    """The trial whose rms error is the (lower) median, and of how many."""
    ordered = (judged["error"] ** 2).groupby(judged["trial"]).mean().reset_index().sort_values(["error", "trial"])
    return str(ordered["trial"].iloc[(len(ordered) - 1) // 2]), len(ordered)


def _block(over_time: s.Panels, beside: s.Panels, rows: pd.DataFrame, block: Block) -> None:
    begin = rows["time"].iloc[0]
    begin = max(begin, rows.loc[np.isfinite(rows["error"]), "time"].iloc[0] - 1.0)  # long before is nothing to see
    shown = rows[(rows["time"] >= begin) & (rows["time"] <= begin + LONGEST)]
    c = s.LETTER[block.axis]
    _over_time(over_time, shown, c)
    over_time[0].set_title(s.plain(_title(rows, shown, block)), fontsize=8.5, pad=14)
    _phase(beside[0], shown, c)
    _against(beside[1], shown, c)


def _title(rows: pd.DataFrame, shown: pd.DataFrame, block: Block) -> str:
    said = f"{block.trial}, {block.axis}: error {_rms_mm(rows['error']):.2f} mm rms"
    if block.of > 1:
        said += f", the median of {block.of} trials by {block.ranked} error"
    if np.ptp(shown["time"]) < 0.9 * np.ptp(rows["time"]):
        said += f", {np.ptp(shown['time']):.0f} s of {np.ptp(rows['time']):.0f} s"
    return said


def _over_time(panels: s.Panels, rows: pd.DataFrame, c: str) -> None:
    t = _v(rows, "time")
    pairs = ((0, "zmp", "zmp_model"), (2, "acceleration", "acceleration_model"), (4, "com_measured", "com_free"))
    for k, measured, model in pairs:
        s.line(panels[k], t, _v(rows, measured), s.MEASURED, "measured", 1.7)
        s.line(panels[k], t, _v(rows, model), s.MODEL, "model" if k < 4 else "free run", 0.9)
        panels[k].legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=2, borderpad=0)
    s.line(panels[1], t, 1e3 * _v(rows, "error"), s.RESIDUAL, width=0.9)
    s.line(panels[3], t, _v(rows, "r_plant"), s.RESIDUAL, width=0.9)
    labels = (f"ZMP ${c}_Z$ [m]", "error\n[mm]", rf"$\ddot{{{c}}}$ [m/s$^2$]", "$r_P$\n[m/s$^2$]", f"CoM ${c}$ [m]")
    for axes, label in zip(panels, labels, strict=True):
        axes.set_ylabel(label)
    for axes in (panels[1], panels[3]):
        axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    off = _rms_mm(rows["com_free"] - rows["com_measured"])
    panels[4].set_title(f"free run off by {off:.2f} mm rms" if np.isfinite(off) else "no free run", fontsize=7, pad=2)
    panels[-1].set_xlabel("time $t$ [s]")
    panels[0].set_xlim(t[0], t[-1])


def _phase(axes: Axes, rows: pd.DataFrame, c: str) -> None:
    """Measured and free-run CoM in the phase plane, both velocities by the same central difference."""
    time = _v(rows, "time")
    for column, colour, width in (("com_measured", s.MEASURED, 1.5), ("com_free", s.MODEL, 0.8)):
        x = _v(rows, column)
        axes.plot(x, s.difference(x, time), color=colour, lw=width)
    axes.set(xlabel=f"CoM ${c}$ [m]", ylabel=rf"$\dot{{{c}}}$ [m/s]")
    axes.set_title("\nphase portrait, free run blue", fontsize=7)  # the empty line is the block's title


def _against(axes: Axes, rows: pd.DataFrame, c: str) -> None:
    x, y = 1e3 * _v(rows, "zmp"), 1e3 * _v(rows, "error")
    keep = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    keep = keep[:: max(1, len(keep) // 600)]
    axes.plot(x[keep], y[keep], ".", color=s.RESIDUAL, ms=1.5)
    axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    axes.set(xlabel=f"measured ZMP ${c}_Z$ [mm]", ylabel="error [mm]")
    axes.set_title("error over the ZMP", fontsize=7)


def _rms_mm(values: pd.Series) -> float:
    good = values.to_numpy(float)[np.isfinite(values)]
    return 1e3 * float(np.sqrt(np.mean(good**2))) if len(good) else float("nan")


def _v(rows: pd.DataFrame, column: str) -> s.Array:
    return rows[column].to_numpy(float)
