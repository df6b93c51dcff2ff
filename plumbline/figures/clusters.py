"""Clusters of omega, how many there are, and the gains by each method, group by group."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from plumbline.figures import _style as s

MOST = 4  # groups on a page
TINTS = ("#6aa6d6", s.MODEL, "#08315a", "#3f7f8c")  # all blue: these are estimates
MARKS = ("o", "s", "D", "P")
METHODS: dict[str, tuple[str, str, str]] = {  # marker, colour (empty: the cluster's), what it is called
    "output error": ("o", "", "output error"),
    "output error with delay": ("^", "", "with a free delay"),
    "instruments": ("s", "", "instruments"),
    "saturation": ("x", s.MEASURED_TOO, "least squares: the counter-example"),
}
WORST = 2.0  # held-out score that is shown below and above the best one; what is lower is a triangle
KEY = ["subject", "task", "condition"]


@s.styled
def draw(clusters: pd.DataFrame, choice: pd.DataFrame, controller: pd.DataFrame) -> Figure:
    """A row per group: omega of each locus against its reach; held-out score by number of clusters; gains by each method.

    clusters, choice, controller: tables of a part.
    """
    if clusters.empty:
        return s.empty("Clusters of omega and gains", "no loci, so no controller: nobody was pushed or released")
    groups = list(clusters[KEY].drop_duplicates().sort_values(KEY).itertuples(index=False, name=None))
    figure = s.page(1.0 + 2.5 * min(len(groups), MOST))
    grid = figure.subplots(min(len(groups), MOST), 3, squeeze=False, width_ratios=[2.0, 0.8, 1.5])
    for panels, group in zip(grid, groups, strict=False):
        mine, tried, found = (t[(t[KEY] == list(group)).all(axis=1)] for t in (clusters, choice, controller))
        _omega(panels[0], mine, found)
        panels[0].set_title(s.plain(" ".join(w for w in group if w)) + panels[0].get_title(loc="left"), fontsize=7.5)
        _score(panels[1], tried)
        _gains(panels[2], found)
    figure.legend(handles=_keys(clusters, controller), loc="outside upper left", ncols=4, columnspacing=1.2)
    s.footnote(figure, s.not_drawn([" ".join(w for w in group if w) for group in groups[MOST:]], "results/clusters"))
    return figure


def tint(cluster: int, several: bool) -> str:
    """Colour of a cluster, from 1 in ascending omega; of a group with one cluster that of the model."""
    return TINTS[(cluster - 1) % len(TINTS)] if cluster and several else s.MODEL


# -- omega ------------------------------------------------------------------------------------------------------------


def _omega(axes: Axes, clusters: pd.DataFrame, controller: pd.DataFrame) -> None:
    """Loci, and behind them the omega that each cluster has from all its loci together."""
    axes.set(xlabel="reach: farthest CoM from the reference [mm]", ylabel=r"$\omega$ [rad/s]")
    known = clusters[clusters["omega"].notna() & clusters["reach"].notna()]
    batch = _batch(controller)
    if known.empty:
        s.blank(axes, "no locus tells its $\\omega$ alone")
        axes.set(xlabel="", ylabel="")
        return
    several = clusters["cluster"].max() > 1
    low, high = span(known, batch)
    for row in s.rows(batch):
        colour = tint(row.cluster, several)
        axes.axhspan(row.omega_low, row.omega_high, color=colour, alpha=0.22, lw=0, zorder=0)
        axes.axhline(row.omega, color=colour, lw=1.1, zorder=1)
    outside = 0
    for row in s.rows(known):
        colour = tint(row.cluster, several) if row.cluster else s.SUPPORT
        axes.plot([1e3 * row.reach] * 2, [max(row.omega_low, low), min(row.omega_high, high)], color=colour, lw=0.6, zorder=2)
        inside = low <= row.omega <= high
        outside += not inside
        mark = (MARKS[(row.cluster - 1) % len(MARKS)] if row.cluster else "X") if inside else "v" if row.omega < low else "^"
        axes.plot(
            1e3 * row.reach, min(max(row.omega, low), high), mark, color=colour, ms=3.6, mec="white", mew=0.4, clip_on=inside, zorder=3
        )
    axes.set_ylim(low, high)
    without = len(clusters) - len(known)
    said = [
        f"{len(known)} loci",
        f"{outside} off the scale" if outside else "",
        f"{without} without $\\omega$ of its own" if without else "",
    ]
    axes.set_title("\n" + ", ".join(w for w in said if w))


def _batch(controller: pd.DataFrame) -> pd.DataFrame:
    """One row per cluster with its omega."""
    return controller[(controller["method"] == "output error") & controller["omega"].notna()]


def span(known: pd.DataFrame, batch: pd.DataFrame) -> tuple[float, float]:
    """Scale [rad/s] that holds the clusters and nine in ten loci; intervals and single loci may run off it."""
    values = [*batch["omega_low"].dropna(), *batch["omega_high"].dropna(), *known["omega"].quantile([0.05, 0.95])]
    room = 0.6 * (max(values) - min(values)) + 0.05
    return max(min(values) - room, 0.0), max(values) + room


# -- number of clusters -----------------------------------------------------------------------------------------------


def _score(axes: Axes, choice: pd.DataFrame) -> None:
    """Scores against that of one cluster: only differences count."""
    if choice.empty:
        s.blank(axes, "nothing to\ncluster")
        return
    rows = choice.sort_values("number")
    number, score, error = (rows[c].to_numpy(float) for c in ("number", "score", "gain_se"))
    gain = score - score[0]
    error = 2 * np.where(np.isfinite(error), error, 0.0)
    low = max(np.min(gain - error), np.max(gain) - WORST)
    inside = gain >= low
    high = min(np.max((gain + error)[inside]), np.max(gain) + WORST)
    for n, g, e in zip(number[inside], gain[inside], error[inside], strict=True):
        axes.plot([n, n], [g - e, g + e], color=s.MODEL, lw=0.8)
    axes.plot(number[inside], gain[inside], "-o", color=s.MODEL, mfc="white", ms=4, lw=0.7)
    for n in number[~inside]:
        axes.plot(n, low, "v", color=s.MODEL, mfc="white", ms=4)
    chosen = rows["chosen"].to_numpy(bool)
    axes.plot(number[chosen], gain[chosen], "o", color=s.MODEL, ms=5)
    room = 0.06 * (high - low) + 1e-9
    axes.set_ylim(low - room, high + room)
    axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    axes.set(xlabel="number of clusters", ylabel="held-out score, that of one = 0 [1]", xlim=(0.5, max(number.max(), 2) + 0.5))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_title(f"{int(number[chosen][0])} chosen" if chosen.any() else "none chosen")


# -- gains ------------------------------------------------------------------------------------------------------------


def _gains(axes: Axes, controller: pd.DataFrame) -> None:
    rows = controller[controller["k1"].notna() & controller["method"].isin(list(METHODS))]
    if rows.empty:
        reasons = sorted(set(controller["warning"]) - {""})
        s.blank(axes, s.plain(reasons[0]) if reasons else "no gains")
        return
    several = controller["cluster"].max() > 0
    largest = rows["cluster"] == rows["cluster"].to_numpy()[int(rows["loci"].argmax())]
    rows = rows[largest | (rows["method"] == "output error")]  # of smaller clusters only the method that counts
    for row in s.rows(rows):
        mark, colour, _ = METHODS[row.method]
        colour = colour or tint(row.cluster, several)
        style: dict[str, Any] = {"color": colour, "zorder": 2 if row.method == "output error" else 1.5}
        width, fill = (1.3, colour) if row.method == "output error" else (0.6, "white")
        mark = MARKS[(row.cluster - 1) % len(MARKS)] if row.cluster and row.method == "output error" else mark
        axes.plot([row.k1_low, row.k1_high], [row.k2, row.k2], lw=width, **style)
        axes.plot([row.k1, row.k1], [row.k2_low, row.k2_high], lw=width, **style)
        axes.plot(row.k1, row.k2, mark, ms=4.5, mfc=fill, mew=0.9, **style)
    axes.set(xlabel="$k_1$ [1]", ylabel="$k_2$ [s]", xlim=reach(rows, "k1"), ylim=reach(rows, "k2"))
    axes.set_title("gains by each method")


def reach(rows: pd.DataFrame, name: str) -> tuple[float, float]:
    """Scale that holds every estimate and the intervals of the largest cluster; those of few loci or of a free delay may run off it."""
    largest = rows[(rows["loci"] == rows["loci"].max()) & (rows["method"] != "output error with delay")]
    values = pd.concat([rows[name], largest[f"{name}_low"], largest[f"{name}_high"]]).dropna()
    room = 0.35 * (values.max() - values.min()) + 0.002 * abs(values.mean()) + 1e-9
    return float(values.min() - room), float(values.max() + room)


# -- words ------------------------------------------------------------------------------------------------------------


def _keys(clusters: pd.DataFrame, controller: pd.DataFrame) -> list[Artist]:
    several = bool(clusters["cluster"].max() > 1)
    colour = s.MODEL
    keys: list[Artist] = [
        Line2D([], [], color=tint(k, several), marker=MARKS[(k - 1) % len(MARKS)], lw=0.6, ms=5, mec="white",
               label=f"loci of cluster {k}" if several else "one locus")
        for k in sorted(set(clusters["cluster"]) - {0})
    ]  # fmt: skip
    keys.append(Patch(color=colour, alpha=0.22, lw=0, label=r"$\omega$ from all of them, with 95 % interval"))
    present = [m for m in METHODS if (controller["k1"].notna() & (controller["method"] == m)).any()]
    for method in present:
        mark, fixed, name = METHODS[method]
        full = method == "output error"
        keys.append(
            Line2D([], [], color=fixed or colour, marker=mark, mfc=fixed or colour if full else "white", ms=4.5, lw=0.8, label=name)
        )
    return keys
