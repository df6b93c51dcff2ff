"""Where the model fails: the error over the phase plane, against time since the push, by trial and by frequency."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from plumbline.figures import _style as s

FEWEST = 10  # frames in a bin that is drawn
TITLES = (
    "mean error over the phase plane",
    "rms error over the phase plane",
    "error since the locus began (mean dashed)",
    "error by trial (dots rms, bars mean)",
    "spectrum of the error",
)
SIGNED = LinearSegmentedColormap.from_list("signed", ["#4b2a7b", "#b9a8d4", "#f7f7f7", "#f6b27a", s.RESIDUAL, "#7f3300"])
LEVEL = LinearSegmentedColormap.from_list("level", ["#fff4ea", "#f6b27a", s.RESIDUAL, "#5c2500"])


@s.styled
def draw(where: pd.DataFrame) -> Figure:
    """Five views of both axes, all subjects, tasks and conditions pooled.  where: the table of all parts."""
    if where.empty:
        return s.empty("Where the model fails", "no trial could be left out and judged: see the first lines of the report")
    judged = [a for a in s.LETTER if (where["axis"] == a).any()]
    figure = s.page(10.2 if len(judged) == 2 else 7.0)
    for axis, column in zip(judged, _panels(figure, len(judged)), strict=True):
        mine = where[where["axis"] == axis]
        _phase(column[0], mine, s.LETTER[axis], "mean")
        _phase(column[1], mine, s.LETTER[axis], "rms")
        _time(column[2], mine)
        _trial(column[3], mine)
        _frequency(column[4], mine)
        for axes, title in zip(column, TITLES, strict=True):
            axes.set_title(f"{axis}: {title}")
    lacking = [a for a in s.LETTER if a not in judged]
    note = f"Bins with fewer than {FEWEST} frames are left blank." + (f" Nothing was judged {lacking[0]}." if lacking else "")
    s.footnote(figure, note)
    return figure


def _panels(figure: Figure, axes: int) -> list[list[Axes]]:
    """Five panels per axis: a column each, or two columns for one axis alone."""
    if axes == 2:
        grid = figure.subplots(len(TITLES), 2, height_ratios=[1.25, 1.25, 0.9, 0.9, 0.9])
        return [list(grid[:, 0]), list(grid[:, 1])]
    flat = list(figure.subplots(3, 2, height_ratios=[1.25, 0.9, 0.9]).flat)
    flat[-1].set_axis_off()
    return [flat[:-1]]


def pooled(where: pd.DataFrame, view: str, by: list[str]) -> pd.DataFrame:
    """Mean and rms of the error [m] per bin of a view, from the sums; count beside them."""
    mine = where[where["view"] == view].groupby(by, as_index=False, sort=True)[["count", "sum", "square_sum"]].sum()
    return mine.assign(mean=mine["sum"] / mine["count"], rms=np.sqrt(mine["square_sum"] / mine["count"]))


def _phase(axes: Axes, where: pd.DataFrame, c: str, which: str) -> None:
    bins = pooled(where, "phase", ["a", "b"])
    if not (bins["count"] >= FEWEST).any():
        s.blank(axes, f"no bin holds {FEWEST} frames")
        return
    a, b, z = grid(bins, which)
    reach = float(np.nanquantile(np.abs(z), 0.99)) or 1e-9
    limits: dict[str, Any] = (
        {"vmin": -reach, "vmax": reach, "cmap": SIGNED} if which == "mean" else {"vmin": 0.0, "vmax": reach, "cmap": LEVEL}
    )
    mesh = axes.pcolormesh(a, b, z, rasterized=z.size > 4000, edgecolors="face", linewidth=0.3, **limits)  # no seams
    bar = axes.figure.colorbar(mesh, ax=axes, pad=0.02, aspect=14, extend="both" if which == "mean" else "max")
    bar.set_label(f"{which} error [mm]")
    bar.outline.set_visible(False)
    axes.set(xlabel=f"CoM from its median ${c}$ [m]", ylabel=rf"velocity $\dot{{{c}}}$ [m/s]")


def grid(bins: pd.DataFrame, which: str) -> tuple[s.Array, s.Array, s.Array]:
    """Edges of the bins and their values [mm], NaN where a bin holds less than FEWEST frames; no blank border."""
    a, b = (_centres(bins[k].to_numpy()) for k in ("a", "b"))
    z = np.full((len(b), len(a)), np.nan)
    shown = (1e3 * bins[which]).where(bins["count"] >= FEWEST)
    z[_index(bins["b"].to_numpy(), b), _index(bins["a"].to_numpy(), a)] = shown
    rows, columns = (np.flatnonzero(np.isfinite(z).any(axis=k)) for k in (1, 0))
    inner = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    return _edges(a)[columns[0] : columns[-1] + 2], _edges(b)[rows[0] : rows[-1] + 2], z[inner]


def _centres(values: s.Array) -> s.Array:
    """All centres between the lowest and the highest, gaps included."""
    known = np.unique(values)
    step = float(np.min(np.diff(known))) if len(known) > 1 else 1.0
    return np.asarray(known[0] + step * np.arange(round((known[-1] - known[0]) / step) + 1))


def _index(values: s.Array, centres: s.Array) -> NDArray[np.int64]:
    step = centres[1] - centres[0] if len(centres) > 1 else 1.0
    return np.asarray(np.round((values - centres[0]) / step).astype(np.int64))


def _edges(centres: s.Array) -> s.Array:
    step = centres[1] - centres[0] if len(centres) > 1 else 0.01
    return np.append(centres - step / 2, centres[-1] + step / 2)


def _time(axes: Axes, where: pd.DataFrame) -> None:
    bins = pooled(where, "time", ["a"])
    bins = bins[bins["count"] >= FEWEST]
    if bins.empty:
        s.blank(axes, "no loci, so no time since one began")
        return
    axes.plot(bins["a"], 1e3 * bins["rms"], color=s.RESIDUAL, lw=1.4)
    axes.plot(bins["a"], 1e3 * bins["mean"], color=s.RESIDUAL, lw=0.9, ls="--")
    axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    axes.set(xlabel="time since the locus began [s]", ylabel="error [mm]")


def _trial(axes: Axes, where: pd.DataFrame) -> None:
    bins = pooled(where, "trial", ["subject", "trial"])
    if bins.empty:
        s.blank(axes, "nothing was judged along this axis")
        return
    number = np.arange(1, len(bins) + 1)
    axes.plot(number, 1e3 * bins["rms"], "o", color=s.RESIDUAL, ms=3.5 if len(bins) < 80 else 1.5)
    axes.plot(number, 1e3 * bins["mean"], "_", color=s.RESIDUAL, ms=5 if len(bins) < 80 else 2)
    axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    for k in np.flatnonzero(bins["subject"].to_numpy()[1:] != bins["subject"].to_numpy()[:-1]) if len(bins) < 300 else []:
        axes.axvline(k + 1.5, color=s.FAINT, lw=0.5, zorder=0)
    axes.set(xlabel="trial, in the order of subject and name", ylabel="error [mm]")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _frequency(axes: Axes, where: pd.DataFrame) -> None:
    bins = pooled(where, "frequency", ["a"])
    if bins.empty:
        s.blank(axes, "no unbroken piece is long enough for a spectrum")
        return
    axes.loglog(bins["a"], 1e3 * bins["rms"], color=s.RESIDUAL, lw=1.2)
    axes.set(xlabel="frequency $f$ [Hz]", ylabel=r"error [mm/$\sqrt{\mathrm{Hz}}$]")
