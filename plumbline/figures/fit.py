"""Natural frequency with its 95 % interval: per subject, per condition, per locus."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from plumbline.figures import _style as s

MOST = 8  # subjects on a page
CEILING = 8.0  # [rad/s]; a CoM 15 cm high
ROW = 0.2  # [in]


@s.styled
def draw(fit: pd.DataFrame) -> Figure:
    """Left lateral, right forward.  fit: table of a part."""
    if fit.empty:
        return s.empty("Natural frequency of the CoM over the ZMP", "no trial of this part has both a CoM and a ZMP that vary")
    subjects = sorted(fit["subject"].unique())
    shown = fit[fit["subject"].isin(subjects[:MOST])]
    rows = layout(shown)
    figure = s.page(1.3 + ROW * (max(y for _, y, _ in rows) + 1))
    panels = figure.subplots(1, 2, sharey=True)
    for axes, axis in zip(panels, s.LETTER, strict=True):
        _panel(axes, shown[shown["axis"] == axis], rows, axis)
    panels[0].set_yticks([y for _, y, _ in rows], [_name(key) for key, _, _ in rows])
    panels[0].invert_yaxis()
    figure.legend(handles=_keys(), loc="outside upper left", ncols=4, columnspacing=1.5)
    s.footnote(figure, s.not_drawn(subjects[MOST:], "results/fit"))
    return figure


Key = tuple[str, str, str, str]  # subject, level, task, condition


def layout(fit: pd.DataFrame) -> list[tuple[Key, float, float]]:
    """Rows of the figure from top to bottom: (key, position, height); loci of a subject share one high row."""
    out: list[tuple[Key, float, float]] = []
    y = 0.0
    for subject, mine in fit.groupby("subject", sort=True):
        out.append(((str(subject), "subject", "", ""), y, 1.0))
        y += 1.0
        pooled = mine[mine["level"] == "condition"]
        groups = sorted(set(zip(pooled["task"], pooled["condition"], strict=True)))
        for task, condition in groups if len(groups) > 1 else []:
            out.append(((str(subject), "condition", task, condition), y, 1.0))
            y += 1.0
        loci = max(((mine["level"] == "locus") & (mine["axis"] == a)).sum() for a in s.LETTER)
        if loci:
            height = min(max(1.5, 0.35 * loci), 8.0)
            out.append(((str(subject), "locus", "", ""), y + height / 2 - 0.5, height))
            y += height
        y += 0.6
    return out


def _name(key: Key) -> str:
    subject, level, task, condition = key
    return s.plain({"subject": subject, "condition": f"{task} {condition}".strip(), "locus": "each locus"}[level])


def _panel(axes: Axes, fit: pd.DataFrame, rows: list[tuple[Key, float, float]], axis: str) -> None:
    axes.set_title(axis)
    axes.set_xlabel(r"natural frequency $\omega$ [rad/s]")
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color="#ececec", lw=0.6)
    if not np.isfinite(fit.loc[fit["level"] != "locus", "omega"]).any():
        _without(axes, fit, axis)
        return
    axes.set_xlim(*span(fit))
    outside = 0
    for (subject, level, task, condition), y, height in rows:
        mine = fit[(fit["subject"] == subject) & (fit["level"] == level)]
        if level == "condition":
            mine = mine[(mine["task"] == task) & (mine["condition"] == condition)]
        outside += _row(axes, mine.sort_values(["trial", "locus"]), level, y, height)
    if outside:
        axes.set_title(f"{axis} (triangles: {outside} off the scale)")


def _without(axes: Axes, fit: pd.DataFrame, axis: str) -> None:
    reason = "no estimate" if fit.empty else "$\\omega^2$ is not positive: here the CoM\nmoves too little, or not by falling"
    axes.text(0.5, 0.5, f"{axis}: {reason}", transform=axes.transAxes, ha="center", va="center", color="#555555", fontsize=7.5)
    axes.set_xlim(0, CEILING)


def span(fit: pd.DataFrame) -> tuple[float, float]:
    """Scale [rad/s] that holds what was pooled and the middle 90 % of the loci; some single loci may run off it."""
    pooled = fit[fit["level"] != "locus"]
    parts = [pooled[k].to_numpy(float) for k in ("omega", "omega_low", "omega_high")] + [fit["omega_height"].to_numpy(float)]
    known = fit["omega"].dropna().to_numpy(float)
    values = np.concatenate([*parts, np.quantile(known, [0.05, 0.95]) if len(known) else known])
    values = values[(values > 0) & (values <= CEILING)]
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, CEILING)
    room = 0.08 * (high - low) + 0.05
    return max(0.0, low - room), high + room


def _row(axes: Axes, mine: pd.DataFrame, level: str, y: float, height: float) -> int:
    """Draw the estimates of one row; returns how many lie off the scale."""
    size, width, colour = (3.0, 0.7, s.MODEL) if level == "locus" else (5.0, 1.6, s.MODEL)
    place = y + (np.linspace(-0.5, 0.5, len(mine) + 2)[1:-1] * height if level == "locus" else np.zeros(len(mine)))
    low, high = axes.get_xlim()
    outside = 0
    for at, one in zip(place, s.rows(mine), strict=True):
        if one.omega_height == one.omega_height and level != "locus":
            axes.plot(one.omega_height, at, "D", mfc="white", mec=s.MEASURED, ms=4, mew=0.8, zorder=2)
        if not low <= one.omega <= high:
            axes.plot(low if not one.omega > high else high, at, "<" if not one.omega > high else ">", color=colour, ms=3, clip_on=False)
            outside += 1
            continue
        axes.plot([one.omega_low, one.omega_high], [at, at], color=colour, lw=width, zorder=3)
        axes.plot(one.omega, at, "o", color=colour, mfc="white" if one.warning else colour, ms=size, mew=0.9, zorder=4)
    return outside


def _keys() -> list[Line2D]:
    blue: dict[str, Any] = {"color": s.MODEL, "lw": 1.4, "marker": "o", "ms": 4}
    return [
        Line2D([], [], label=r"$\omega$ with 95 % interval", **blue),
        Line2D([], [], label="the same, with a warning", **blue, mfc="white"),
        Line2D([], [], label=r"$\sqrt{g/z}$ at the mean height", marker="D", mfc="white", mec=s.MEASURED, ms=4, lw=0),
    ]
