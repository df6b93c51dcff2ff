"""Fig. 4: standing up, is a step needed? Extrapolated CoM over the feet, its margin, and the step that is missing."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from plumbline.figures import _style as s

WHO = {"true": s.MEASURED, "table": s.MEASURED_TOO, "own": s.MODEL}
LIFT = 0.85  # [1] of the load under the feet, from which on the seat is left; hands keep a little


@s.styled
def draw(stability: pd.DataFrame) -> Figure:
    """Three panels over time.  stability: table of that name."""
    page = s.page(5.6, 5.2)
    top, middle, bottom = page.subplots(3, 1, sharex=True, height_ratios=[1.5, 1, 1])
    time = stability["time"].to_numpy(float)
    top.fill_between(time, 1e3 * stability["back"], 1e3 * stability["front"], color=s.FAINT, alpha=0.6, lw=0, zorder=0)
    middle.axhspan(0, 1e3 * float(np.nanmax(stability["true_margin"])) * 1.6, color=s.RECOVERABLE, lw=0, zorder=0)
    for name, colour in WHO.items():
        width = 1.3 if name == "own" else 1.0
        s.line(top, time, 1e3 * stability[f"{name}_x"].to_numpy(float), colour, width=0.8, style=":")
        for axes, what in ((top, "xi"), (middle, "margin"), (bottom, "step")):
            s.line(axes, time, 1e3 * stability[f"{name}_{what}"].to_numpy(float), colour, width=width)
    _lifted((top, middle, bottom), stability)
    top.set_ylabel(r"$\xi$ and CoM, forward [mm]")
    middle.set(ylabel="margin [mm]")
    bottom.set(ylabel="missing step [mm]\n(forward positive)", xlabel="time [s]")
    for axes in (middle, bottom):
        axes.axhline(0, color="#bbbbbb", lw=0.6, zorder=0)
    top.set_xlim(time[0], time[-1])
    page.legend(handles=_keys(), loc="outside upper left", ncols=3, columnspacing=1.4)
    s.footnote(page, "Feet alone: a seat or hands that bear weight widen the support, and no margin here counts them.")
    return page


def _lifted(panels: tuple[Axes, ...], table: pd.DataFrame) -> None:
    """Mark when the seat is left."""
    late = table["carried"].to_numpy(float) > LIFT
    if not late.any() or late.all():
        return
    at = float(table["time"].iloc[int(np.argmax(late))])
    for axes in panels:
        axes.axvline(at, color=s.RESIDUAL, lw=0.8, ls="--", zorder=1)
    panels[0].text(at, 0.03, " the seat is left", transform=panels[0].get_xaxis_transform(), color=s.RESIDUAL, fontsize=7)


def _keys() -> list[Line2D | Patch]:
    return [
        Line2D([], [], color=s.MEASURED, lw=1.0, label=r"true $\xi = x + \dot x/\omega$"),
        Line2D([], [], color=s.MEASURED_TOO, lw=1.0, label="segment table"),
        Line2D([], [], color=s.MODEL, lw=1.3, label="calibrated"),
        Line2D([], [], color=s.MEASURED, lw=0.8, ls=":", label="the CoM itself"),
        Patch(color=s.FAINT, alpha=0.6, label="from heels to toes"),
    ]
