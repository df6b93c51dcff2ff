"""Fig. 5: all measured loci in the phase plane, by how they begin and end."""

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from murai2013.figures import NAMES, phase
from plumbline.figures import _style as s


@s.styled
def draw(tracks: pd.DataFrame) -> Figure:
    """One panel per condition.  tracks: table of that name."""
    if tracks.empty:
        return s.empty("Measured loci", "no locus was found")
    conditions = sorted(tracks["condition"].unique())
    figure = s.page(4.1)
    panels = np.atleast_1d(figure.subplots(1, len(conditions), sharex=True, sharey=True))
    for axes, condition in zip(panels, conditions, strict=True):
        mine = tracks[tracks["condition"] == condition]
        phase.tracks(axes, mine)
        for limit in ("limit_left", "limit_right"):
            axes.axvline(mine[limit].median(), color=s.MEASURED_TOO, lw=0.7, ls="-.", zorder=0.5)
        axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
        axes.set_xlabel(phase.LABELS[0])
        axes.set_title(f"{NAMES[condition]}: {mine.groupby(['trial', 'locus']).ngroups} loci")
    panels[0].set_ylabel(phase.LABELS[1])
    figure.legend(handles=phase.track_keys(tracks), loc="outside upper left", ncols=4, columnspacing=1.5)
    note = "Dots: where a locus begins. Position and velocity: parabolas over 0.2 s of the unfiltered CoM. Dash-dotted: edges of the feet."
    s.footnote(figure, note)
    return figure
