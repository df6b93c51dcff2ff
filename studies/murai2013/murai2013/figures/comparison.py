"""The paper's values, what was identified, and the truth of the simulated subject."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from murai2013.figures import NAMES
from plumbline.figures import _style as s

PANELS = (
    ("natural frequency [rad/s]", {"omega_far": r"$\omega$ far", "omega_near": r"$\omega$ near"}, 1.0),
    ("gain $k_1$ [1]", {"k1": "$k_1$"}, 1.0),
    ("gain $k_2$ [s]", {"k2": "$k_2$"}, 1.0),
    ("ZMP limits and reference [mm]", {"limit_left": "left limit", "reference": "reference $d$", "limit_right": "right limit"}, 1e3),
)


@s.styled
def draw(comparison: pd.DataFrame) -> Figure:
    """Four groups of numbers, each as value and as difference from the truth.  comparison: table of that name."""
    rows = [len(items) * comparison["condition"].nunique() for _, items, _ in PANELS]
    figure = s.page(1.1 + 0.26 * (sum(rows) + 2 * len(PANELS)))
    panels = figure.subplots(len(PANELS), 2, height_ratios=[n + 0.8 for n in rows], width_ratios=[1.5, 1])
    for (label, items, scale), (left, right) in zip(PANELS, panels, strict=True):
        mine = comparison[comparison["item"].isin(items)]
        order = mine["item"].map(list(items).index)
        mine = mine.assign(order=order).sort_values(["condition", "order"])
        _values(left, mine, items, label, scale)
        _errors(right, mine, scale)
        right.set_xlabel("identified less truth " + label[label.rindex("[") :])
    figure.legend(handles=_keys(), loc="outside upper left", ncols=3, columnspacing=1.5)
    s.footnote(figure, "A: " + NAMES["free"][3:] + "; B: " + NAMES["held"][3:] + ". The paper prints no limits and no reference.")
    return figure


def _values(axes: Axes, mine: pd.DataFrame, items: dict[str, str], label: str, scale: float) -> None:
    place = np.arange(len(mine))
    axes.plot(scale * mine["truth"], place, "|", color=s.RESIDUAL, ms=13, mew=1.6, zorder=2)
    axes.plot(scale * mine["paper"], place - 0.22, "D", color=s.MEASURED, mfc="white", ms=4, mew=0.9, zorder=3)
    for y, row in zip(place, s.rows(mine), strict=True):
        axes.plot([scale * row.low, scale * row.high], [y, y], color=s.MODEL, lw=1.6, zorder=4)
    axes.plot(scale * mine["identified"], place, "o", color=s.MODEL, ms=4, zorder=5)
    names = {"free": "A", "held": "B"}
    axes.set_yticks(place, [f"{names[c]}, {items[i]}" for c, i in zip(mine["condition"], mine["item"], strict=True)])
    axes.set(xlabel=label, ylim=(len(mine) - 0.4, -0.6))
    _plain(axes)


def _errors(axes: Axes, mine: pd.DataFrame, scale: float) -> None:
    axes.axvline(0, color=s.RESIDUAL, lw=1.2, zorder=1)
    for y, row in enumerate(s.rows(mine)):
        axes.plot([scale * (row.low - row.truth), scale * (row.high - row.truth)], [y, y], color=s.MODEL, lw=1.6, zorder=2)
        axes.plot(scale * row.error, y, "o", color=s.MODEL, ms=4, zorder=3)
    axes.set(ylim=(len(mine) - 0.4, -0.6), yticks=[])
    _plain(axes)


def _plain(axes: Axes) -> None:
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color="#ececec", lw=0.6)
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _keys() -> list[Line2D]:
    return [
        Line2D([], [], color=s.MEASURED, marker="D", mfc="white", ms=4, mew=0.9, lw=0, label="printed in the paper"),
        Line2D([], [], color=s.MODEL, marker="o", ms=4, lw=1.6, label="identified, 95 % interval"),
        Line2D([], [], color=s.RESIDUAL, marker="|", ms=11, mew=1.6, lw=0, label="truth of the simulated subject"),
    ]
