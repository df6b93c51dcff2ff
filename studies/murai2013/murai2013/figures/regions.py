"""Fig. 2: the closed loop over the phase plane, with the regions in which the ZMP is at a limit (S1, S3) or follows the law (S2)."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from murai2013.figures import NAMES, phase
from plumbline.figures import _style as s

HIGH = 0.42  # [m/s] at which S2 is named


@s.styled
def draw(portrait: pd.DataFrame) -> Figure:
    """One panel per condition, for the gains and the largest omega identified.  portrait: table of that name."""
    if portrait.empty:
        return s.empty("Phase portrait of the closed loop", "no controller with both limits was identified")
    conditions = sorted(portrait["condition"].unique())
    figure = s.page(4.1)
    panels = np.atleast_1d(figure.subplots(1, len(conditions), sharey=True))
    for axes, condition in zip(panels, conditions, strict=True):
        mine = portrait[portrait["condition"] == condition]
        mine = mine[mine["cluster"] == mine["cluster"].max()]
        phase.portrait(axes, mine, field=True)
        _names(axes, mine)
        axes.set_title(NAMES[condition])
    panels[-1].set_ylabel("" if len(panels) > 1 else phase.LABELS[1])
    figure.legend(handles=phase.model_keys(), loc="outside upper left", ncols=3, columnspacing=1.5)
    note = "S1, S3: the ZMP is held at its left, right limit; S2 (shaded): it follows the law. Dot: reference; crosses: saddle points."
    s.footnote(figure, note)
    return figure


def _names(axes: Axes, lines: pd.DataFrame) -> None:
    """Regions by name, the reference, and the two saddle points, where the separatrices end."""
    box = {"boxstyle": "round,pad=0.2", "fc": "white", "ec": "none", "alpha": 0.85}
    limit = lines[lines["part"] == "separatrix"].groupby("line")["x"].first()
    centre = lines.loc[lines["part"] == "field", "x"].mean()
    band = [np.interp(HIGH, one["v"], one["x"]) for _, one in lines[lines["part"] == "region"].sort_values("v").groupby("line")]
    low, high = axes.get_xlim()
    places = {"S1": ((low + limit.min()) / 2, -0.3), "S2": (np.mean(band), HIGH), "S3": ((high + limit.max()) / 2, 0.3)}
    for name, (x, v) in places.items():
        axes.text(x, v, name, ha="center", va="center", bbox=box, zorder=6, fontsize=9)
    axes.plot(centre, 0, "o", color=s.MODEL, ms=4, zorder=5)
    axes.plot(limit, 0 * limit, "x", color=s.MODEL, ms=6, mew=1.5, zorder=5)
