"""omega that the paper's method prints for a man of its subject's size, with one candidate at a time."""

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from plumbline.figures import _style as s

LOCI = {"near": ("o", "returns"), "beyond": ("s", "begins beyond the stance"), "falling": ("v", "falls")}


@s.styled
def draw(candidates: pd.DataFrame, published: pd.DataFrame) -> Figure:
    """One row per candidate.  candidates, published: tables of these names."""
    if candidates.empty:
        return s.empty("Candidates for the paper's omegas", "no candidate was simulated")
    figure = s.page(1.5 + 0.28 * len(candidates))
    axes = figure.subplots()
    for value in published.loc[published["item"].str.startswith("omega"), "value"]:
        axes.axvline(value, color=s.MEASURED, lw=0.8, zorder=1)
    axes.axvline(candidates["point_mass"].iloc[0], color=s.SUPPORT, lw=1.6, zorder=1)
    for y, row in enumerate(s.rows(candidates)):
        axes.plot(row.weak, y, "|", color=s.RESIDUAL, ms=12, mew=1.8, zorder=2)
        for column, (mark, _) in LOCI.items():
            axes.plot(getattr(row, column), y, mark, color=s.MODEL, ms=5, zorder=3)
    axes.set_yticks(range(len(candidates)), candidates["candidate"])
    axes.set(xlabel=r"$\omega$ [rad/s]", ylim=(len(candidates) - 0.4, -0.6))
    axes.grid(axis="y", color="#ececec", lw=0.6)
    figure.legend(handles=_keys(), loc="outside upper left", ncols=3, columnspacing=1.5)
    s.footnote(figure, "Blue: signals low-passed at 2 Hz, least squares through zero, median over loci.")
    return figure


def _keys() -> list[Line2D]:
    loci = [Line2D([], [], color=s.MODEL, marker=mark, ms=5, lw=0, label=f"as the paper reads, {name}") for mark, name in LOCI.values()]
    return [
        *loci,
        Line2D([], [], color=s.RESIDUAL, marker="|", ms=11, mew=1.8, lw=0, label="unfiltered, with a constant"),
        Line2D([], [], color=s.MEASURED, lw=0.8, label="printed in the paper"),
        Line2D([], [], color=s.SUPPORT, lw=1.6, label="point mass, g/z"),
    ]
