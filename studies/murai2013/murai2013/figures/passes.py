"""Figs. 6, 7 and 8: recursive least squares along one locus, forward and returning, and the switch that it shows."""

from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from plumbline.figures import _style as s
from plumbline.trust import STRAYS

Array = NDArray[np.float64]

ESTIMATES = {"omega": r"$\omega$ [rad/s]", "k1": "$k_1$ [1]", "k2": "$k_2$ [s]"}
BAND = "#cfe1f0"  # two standard deviations of an estimate
LATE = {"forward": 0.9, "backward": 0.7}  # [1] share of a pass, its later one, that sets the scale


class Sheet(NamedTuple):
    """What one figure shows: its title, the pass it is about, the pass drawn thin beside it (empty: none)."""

    title: str
    about: str
    other: str


SHEETS = {
    "fig6": Sheet("Recovering locus, forward pass: from its start to this instant", "forward", ""),
    "fig7": Sheet("The same locus, returning pass: from its end back to this instant", "backward", "forward"),
    "fig8": Sheet("Falling locus, order reversed: backward first, then returning from its start", "forward", "backward"),
}


@s.styled
def draw(passes: pd.DataFrame, switches: pd.DataFrame, *, figure: str) -> Figure:
    """Measured CoM and ZMP, one estimate per panel, and in figs. 7 and 8 the statistic of the rule.

    passes, switches: tables of these names.
    """
    sheet = SHEETS[figure]
    frames, parts = passes[passes["figure"] == figure], switches[switches["figure"] == figure]
    if frames.empty:
        return s.empty(sheet.title, "no locus of this kind has a single switch")
    returning = bool(sheet.other)
    page = s.page(6.0 if returning else 5.0)
    panels = page.subplots(4 + returning, 1, sharex=True)
    time = frames["time"].to_numpy(float) - float(parts["start"].min())
    s.line(panels[0], time, frames["p"].to_numpy(float), s.MEASURED_TOO, "ZMP $x_Z$", 0.8)
    s.line(panels[0], time, frames["x"].to_numpy(float), s.MEASURED, "CoM $x$", 1.2)
    panels[0].set_ylabel("measured [m]")
    panels[0].set_title(s.plain(f"{sheet.title}\n{frames['trial'].iloc[0]}"))
    panels[0].legend(loc="upper right", ncols=2)
    for axes, name in zip(panels[1:4], ESTIMATES, strict=True):
        _estimate(axes, time, frames, name, sheet)
    if returning:
        s.line(panels[4], time, frames["stray"].to_numpy(float), s.MODEL, width=1.2)
        for sign in (-1, 1):
            panels[4].axhline(sign * STRAYS, color=s.RESIDUAL, lw=0.8, zorder=0)
        panels[4].set_ylabel("strays by [sd]")
    for axes in panels:
        _switches(axes, parts, returning)
    panels[-1].set_xlabel("time since the locus began [s]")
    page.align_ylabels(list(panels))
    page.legend(handles=_keys(sheet, parts), loc="outside upper left", ncols=3, columnspacing=1.5)
    return page


def _estimate(axes: Axes, time: Array, frames: pd.DataFrame, name: str, sheet: Sheet) -> None:
    """An estimate with its deviation: from the value that the forward pass ends with, or two standard deviations of the backward one."""
    about, sd = _values(frames, name, sheet.about), frames[f"{name}_sd"].to_numpy(float)
    if sheet.other:
        s.line(axes, time, _values(frames, name, sheet.other), s.MODEL, width=0.7, style=":")
    else:
        known = about[np.isfinite(about)]
        axes.fill_between(time, about, known[-1] if len(known) else np.nan, color=s.RESIDUAL, alpha=0.3, lw=0)
    if sheet.about == "backward":
        axes.fill_between(time, about - 2 * sd, about + 2 * sd, color=BAND, lw=0, zorder=0)
    s.line(axes, time, about, s.MODEL, width=1.3)
    axes.set_ylabel(ESTIMATES[name])
    count = round(LATE[sheet.about] * len(about))
    late = slice(None, count) if sheet.about == "backward" else slice(-count, None)
    axes.set_ylim(*_span(about[late]))


def _values(frames: pd.DataFrame, name: str, way: str) -> Array:
    """An estimate; an omega of 0 stands for a w2 that is not positive and is left out."""
    values = frames[f"{name}_{way}"].to_numpy(float)
    return np.where(values > 0, values, np.nan) if name == "omega" else values


def _span(values: Array) -> tuple[float, float]:
    """A scale that holds the estimate once it has seen enough; what runs off it before is cut."""
    good = values[np.isfinite(values)]
    low, high = np.quantile(good, [0.02, 0.98]) if len(good) else (0.0, 1.0)
    room = 0.25 * (high - low) + 0.02 * abs(high) + 1e-3
    return float(low - room), float(high + room)


def _switches(axes: Axes, parts: pd.DataFrame, returning: bool) -> None:
    """The switch by change point (black) and, where that is drawn, by the returning pass (blue)."""
    begin = float(parts["start"].min())
    for found, rls in zip(parts["found"], parts["rls"], strict=True):
        if np.isfinite(found):
            axes.axvline(found - begin, color=s.MEASURED, lw=0.9, zorder=1)
        if returning and np.isfinite(rls):
            axes.axvline(rls - begin, color=s.MODEL, lw=1.1, ls="--", zorder=1)


def _keys(sheet: Sheet, parts: pd.DataFrame) -> list[Line2D | Patch]:
    keys: list[Line2D | Patch] = [Line2D([], [], color=s.MODEL, lw=1.3, label=f"{_called(sheet.about, sheet)} estimate")]
    if sheet.other:
        keys.append(Line2D([], [], color=s.MODEL, lw=0.7, ls=":", label=f"{_called(sheet.other, sheet)} estimate"))
    else:
        keys.append(Patch(color=s.RESIDUAL, alpha=0.3, lw=0, label="its deviation from the value at the end"))
    if sheet.about == "backward":
        keys.append(Patch(color=BAND, lw=0, label="two standard deviations"))
    keys.append(Line2D([], [], color=s.MEASURED, lw=0.9, label="switch by change point"))
    if sheet.other and parts["rls"].notna().any():
        keys.append(Line2D([], [], color=s.MODEL, lw=1.1, ls="--", label="switch by the returning pass"))
    if sheet.other:
        keys.append(Line2D([], [], color=s.RESIDUAL, lw=0.8, label="strays beyond this"))
    return keys


def _called(way: str, sheet: Sheet) -> str:
    return way if not sheet.other or way != sheet.about else f"returning ({way})"
