"""Forty people: how far the CoM is off by each way, why the vertical is a matter of the prior, and what designed holds would tell."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from plumbline.figures import _style as s

LINES = (  # label, way, motion, colour
    ("segment table", "table", "static", s.MEASURED_TOO),
    ("paper's recursion, from zero, bounded", "kalman_bounded", "static", s.RESIDUAL),
    ("paper's recursion, weak prior", "kalman_weak", "static", s.RESIDUAL),
    ("prior and all windows: same 300 s", "batch", "static", s.MODEL),
    ("standing up", "batch", "sts", s.MODEL),
    ("extended protocol", "extended", "extended", s.MODEL),
    ("extended, imperfect instruments", "extended, real", "extended", s.MODEL),
)
HOLDS = {"standing": ("standing only", "-"), "sit": ("one seated first", "--"), "lie": ("one lying first", ":")}


@s.styled
def draw(people: pd.DataFrame, holds: pd.DataFrame) -> Figure:
    """Three panels.  people, holds: tables of these names."""
    page = s.page(5.6)
    both = np.asarray(page.subfigures(2, 1, height_ratios=[1.15, 1]))
    _ways(both[0].subplots(), people)
    left, right = both[1].subplots(1, 2)
    _starts(left, people)
    _holds(right, holds)
    return page


def _ways(axes: Axes, people: pd.DataFrame) -> None:
    """A dot per person, a bar at the median."""
    rng = np.random.default_rng(1)
    for y, (_, way, motion, colour) in enumerate(LINES):
        d = 1e3 * people.loc[(people["way"] == way) & (people["motion"] == motion), "distance"].to_numpy(float)
        axes.plot(d, y + rng.uniform(-0.22, 0.22, len(d)), ".", color=colour, ms=3.5, alpha=0.55, mew=0)
        axes.plot([np.median(d)] * 2, [y - 0.34, y + 0.34], color=colour, lw=2)
        axes.text(1.015, y, f"{np.median(d):.1f} mm", transform=axes.get_yaxis_transform(), va="center", fontsize=7, color=colour)
    axes.set(
        xscale="log",
        ylim=(len(LINES) - 0.5, -0.5),
        xlabel="mean 3-D distance from the true CoM [mm], one dot per person, bar at the median",
    )
    axes.set_yticks(range(len(LINES)), [line[0] for line in LINES])
    axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color="#ececec", lw=0.6)


def _starts(axes: Axes, people: pd.DataFrame) -> None:
    """Vertical error of the paper's recursion over what it believes of its start."""
    mine = people[people["motion"] == "static"]
    for start, style in (("zero", "--"), ("table", "-")):
        named = mine["way"].str.extract(rf"^from {start}, (\S+) m$")[0].dropna().astype(float)
        z = 1e3 * mine.loc[named.index, "rms_z"].groupby(named).median()
        axes.plot(1e3 * z.index, z, style, marker="o", ms=3, color=s.RESIDUAL)
    axes.annotate("paper's, from zero", (3, 160), color=s.RESIDUAL, fontsize=7, va="bottom")
    axes.annotate("paper's, from the\ntable's values", (70, 40), color=s.RESIDUAL, fontsize=7, va="top")
    for way, colour, label in (("table", s.MEASURED_TOO, "segment table"), ("batch", s.MODEL, "people's spread as prior, all windows")):
        z = 1e3 * float(mine.loc[mine["way"] == way, "rms_z"].median())
        axes.axhline(z, color=colour, lw=1.2)
        axes.annotate(label, (1000, 0.93 * z), color=colour, fontsize=7, ha="right", va="top")
    axes.set(
        xscale="log", yscale="log", ylim=(1, 400), xlabel="sd of each parameter at the start [mm]", ylabel="vertical rms error [mm], median"
    )
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.set_title("The vertical is a matter of the prior")


def _holds(axes: Axes, holds: pd.DataFrame) -> None:
    """Predicted vertical sd after each designed hold."""
    for among, (label, style) in HOLDS.items():
        mine = holds[holds["among"] == among].sort_values("hold")
        axes.plot(mine["hold"], 1e3 * mine["sd_z"], style, marker="o", ms=3, color=s.MODEL, label=label)
    axes.set(ylim=(0, None), xlabel="poses held for 5 s, the best next one each", ylabel="predicted vertical sd [mm]")
    axes.set_xticks(sorted(holds["hold"].unique()))
    axes.set_title("What designed poses would tell")
    axes.legend(loc="upper right")
