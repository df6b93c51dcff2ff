"""Figs. 9 and 10: omega of every locus with its interval, against how far the locus went, and the clusters."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from murai2013.figures import NAMES
from plumbline.figures import _style as s

TINTS = ("#6aa6d6", s.MODEL, "#08315a", "#a9cbe6")  # all blue: these are estimates
MARKS = ("o", "s", "D", "P")


@s.styled
def draw(loci: pd.DataFrame, groups: pd.DataFrame, *, condition: str) -> Figure:
    """One panel.  loci, groups: tables of these names (loci: the pipeline's `clusters`)."""
    mine, found = loci[loci["condition"] == condition], groups[groups["condition"] == condition]
    known = mine[mine["omega"].notna()]
    if known.empty:
        return s.empty(f"Clusters of omega, {NAMES[condition]}", "no locus has an estimate of omega")
    figure = s.page(3.3)
    axes = figure.subplots()
    for row in s.rows(found):
        _batch(axes, row)
    low, high = _span(known, found)
    for cluster, part in known.groupby("cluster", sort=True):
        _loci(axes, part, int(str(cluster)), low, high)
    axes.set(ylim=(low, high), xlabel="reach of the locus: farthest CoM from the reference [m]", ylabel=r"$\omega$ [rad/s]")
    off, without = int((~known["omega"].between(low, high)).sum()), len(mine) - len(known)
    said = [f"{len(mine)} loci", f"{off} off the scale (triangles)" if off else "", f"{without} without an estimate" if without else ""]
    axes.set_title(f"{NAMES[condition]}: " + ", ".join(t for t in said if t))
    figure.legend(handles=_keys(found), loc="outside upper left", ncols=2, columnspacing=1.5)
    return figure


def _span(known: pd.DataFrame, found: pd.DataFrame) -> tuple[float, float]:
    """Scale [rad/s] that holds the clusters and nine in ten loci."""
    values = [*found["omega"], *known["omega"].quantile([0.05, 0.95])]
    room = 0.3 * (max(values) - min(values)) + 0.1
    return min(values) - room, max(values) + room


def _batch(axes: Axes, row: pd.Series) -> None:
    """omega of a cluster from all its loci, with its interval."""
    tint = TINTS[(int(row.cluster) - 1) % len(TINTS)]
    axes.axhspan(row.omega_low, row.omega_high, color=tint, alpha=0.25, lw=0, zorder=0)
    axes.axhline(row.omega, color=tint, lw=1.1, zorder=1)


def _loci(axes: Axes, loci: pd.DataFrame, cluster: int, low: float, high: float) -> None:
    tint = TINTS[(cluster - 1) % len(TINTS)] if cluster else s.SUPPORT
    for row in s.rows(loci):
        axes.plot([row.reach] * 2, [row.omega_low, row.omega_high], color=tint, lw=0.6, alpha=0.7, zorder=2)
        inside = low <= row.omega <= high
        mark = (MARKS[(cluster - 1) % len(MARKS)] if cluster else "X") if inside else "v" if row.omega < low else "^"
        style = {"ms": 3.8, "mec": "white", "mew": 0.4, "clip_on": inside, "zorder": 3}
        axes.plot(row.reach, min(max(row.omega, low), high), mark, color=tint, **style)


def _keys(found: pd.DataFrame) -> list[Line2D]:
    return [
        Line2D([], [], color=TINTS[(int(r.cluster) - 1) % len(TINTS)], marker=MARKS[(int(r.cluster) - 1) % len(MARKS)], lw=1.1, ms=4,
               label=rf"cluster {r.cluster}: $\omega$ = {r.omega:.3f} [{r.omega_low:.3f}, {r.omega_high:.3f}] rad/s; gains: {r.loci} loci")
        for r in s.rows(found)
    ]  # fmt: skip
