"""The phase plane: portrait of the closed loop in blue, measured loci in black."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from murai2013.portrait import BOX
from plumbline.figures import _style as s
from plumbline.figures.loci import ENDS, KINDS

LABELS = "CoM $x$ [m], right positive", r"velocity $\dot{x}$ [m/s]"


def portrait(axes: Axes, lines: pd.DataFrame, *, field: bool) -> None:
    """Draw the parts of one portrait.  lines: its rows of table `portrait`.  field: arrows too."""
    region = [r.sort_values("v") for _, r in lines[lines["part"] == "region"].groupby("line")]
    if len(region) == 2:
        axes.fill_betweenx(region[0]["v"], region[0]["x"], region[1]["x"], color=s.RECOVERABLE, lw=0, zorder=0)
    for one in region:
        axes.plot(one["x"], one["v"], color=s.MEASURED_TOO, lw=0.9, ls="-.", zorder=1)
    for _, one in lines[lines["part"] == "flow"].groupby("line"):
        axes.plot(one["x"].iloc[::4], one["v"].iloc[::4], color=s.MODEL, lw=0.5, alpha=0.55, zorder=2)
    for _, one in lines[lines["part"] == "separatrix"].groupby("line"):
        axes.plot(one["x"].iloc[::4], one["v"].iloc[::4], color=s.MODEL, lw=1.5, zorder=3)
    if field:
        _arrows(axes, lines[lines["part"] == "field"])
    centre = float(lines.loc[lines["part"] == "field", "x"].mean())
    axes.set(xlim=(centre - BOX[0], centre + BOX[0]), ylim=(-BOX[1], BOX[1]), xlabel=LABELS[0], ylabel=LABELS[1])


def _arrows(axes: Axes, field: pd.DataFrame) -> None:
    """Directions of the field, all of one length on paper."""
    vx, vv = field["vx"].to_numpy(float) / BOX[0], field["vv"].to_numpy(float) / BOX[1]
    size = np.maximum(np.hypot(vx, vv), 1e-9)
    axes.quiver(
        field["x"], field["v"], vx / size, vv / size, color=s.MODEL, alpha=0.8, angles="uv", pivot="mid",
        scale=34, width=0.0022, headwidth=4, headlength=4.5, zorder=2.5,
    )  # fmt: skip


def tracks(axes: Axes, loci: pd.DataFrame, colour: str = "") -> None:
    """Draw measured loci.  loci: rows of table `tracks`.  colour: of all; without it by kind."""
    for _, one in loci.groupby(["trial", "locus"], sort=True):
        style, own, width = KINDS[one["kind"].iloc[0]]
        last = one.iloc[-1]
        axes.plot(one["x"], one["v"], ls=style, color=colour or own, lw=0.8 * width, zorder=4)
        axes.plot(one["x"].iloc[0], one["v"].iloc[0], ".", color=colour or own, ms=3, zorder=4)
        if last["kind"] in ENDS:
            axes.plot(last["x"], last["v"], ENDS[last["kind"]], color=colour or own, ms=3.5, mfc="none", mew=0.8, zorder=4)


def model_keys() -> list[Line2D]:
    """What the blue and grey lines are."""
    return [
        Line2D([], [], color=s.MODEL, lw=1.5, label="border of what can be brought back"),
        Line2D([], [], color=s.MODEL, lw=0.5, label="trajectories of the model"),
        Line2D([], [], color=s.MEASURED_TOO, lw=0.9, ls="-.", label="the law reaches a limit"),
    ]


def track_keys(loci: pd.DataFrame) -> list[Line2D]:
    """Kinds of measured loci with their number."""
    kinds = loci.groupby(["trial", "locus"])["kind"].first().value_counts()
    return [
        Line2D([], [], ls=style, color=colour, lw=width, marker=ENDS.get(kind, ""), mfc="none", ms=3.5,
               label=f"{kind.replace('_', ' ')} ({kinds[kind]})")
        for kind, (style, colour, width) in KINDS.items() if kind in kinds
    ]  # fmt: skip
