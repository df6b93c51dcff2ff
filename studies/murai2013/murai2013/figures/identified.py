"""Figs. 11 and 12: the identified phase portrait of each cluster with the loci measured in it."""

import pandas as pd
from matplotlib.figure import Figure

from murai2013.figures import NAMES, phase
from plumbline.figures import _style as s


@s.styled
def draw(portrait: pd.DataFrame, tracks: pd.DataFrame, *, condition: str) -> Figure:
    """One panel per cluster of a condition.  portrait, tracks: tables of these names."""
    lines, loci = portrait[portrait["condition"] == condition], tracks[tracks["condition"] == condition]
    if lines.empty:
        return s.empty(f"Identified phase portrait, {NAMES[condition]}", "no controller with both limits was identified")
    clusters = sorted(lines["cluster"].unique())
    rows = -(-len(clusters) // 2)
    figure = s.page(0.9 + 3.2 * rows)
    panels = figure.subplots(rows, min(len(clusters), 2), sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(clusters) :]:
        axes.set_axis_off()
    for axes, cluster in zip(panels.flat, clusters, strict=False):
        mine = lines[lines["cluster"] == cluster]
        phase.portrait(axes, mine, field=False)
        measured = loci[loci["cluster"] == cluster]
        phase.tracks(axes, measured)
        count = measured.groupby(["trial", "locus"]).ngroups
        axes.set_title(rf"cluster {cluster}, $\omega$ = {mine['omega'].iloc[0]:.3f} rad/s: {count} loci")
    for axes in panels[:, 1:].flat:
        axes.set_ylabel("")
    for axes in panels[:-1].flat:
        axes.set_xlabel("")
    keys = [*phase.model_keys(), *phase.track_keys(loci[loci["cluster"].isin(clusters)])]
    figure.legend(handles=keys, loc="outside upper left", ncols=4, columnspacing=1.5, title=NAMES[condition], alignment="left")
    return figure
