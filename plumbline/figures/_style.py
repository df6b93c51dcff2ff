"""What all figures share: one colour per meaning, thinning, honest empty panels, files whose bytes do not change."""

import io
import os
from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from itertools import pairwise
from pathlib import Path
from typing import Any, ParamSpec

import numpy as np
import pandas as pd
from matplotlib import rc_context, rc_params_from_file
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D
from numpy.typing import NDArray

DATA_FILES = ("style.mplstyle",)

Array = NDArray[np.float64]
Panels = NDArray[np.object_]
P = ParamSpec("P")

MEASURED = "#111111"
MEASURED_TOO = "#8c8c8c"  # a second measured signal in the same panel
MODEL = "#0b61a4"
RESIDUAL = "#d95f02"
PUSH = "#f2e6bf"
SUPPORT = "#b5b5b5"
RECOVERABLE = "#f0f5fa"
FAINT = "#d9d9d9"

WIDTH = 7.2  # [in] two columns of a journal
LETTER = {"lateral": "x", "forward": "y"}
POINTS = 600  # bins per line, two samples each: finer than a printed line is wide
STEP = 0.05  # [s] velocities of phase portraits are differences over twice this
MAX_BYTES = 1_000_000  # above this the dense layers of a figure become pixels

_RC = rc_params_from_file(Path(__file__).with_name("style.mplstyle"), use_default_template=False)


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Let a figure be drawn in the common style, whatever the caller's settings are."""

    @wraps(draw)
    def inner(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with rc_context(_RC):
            return draw(*args, **kwargs)

    return inner


def page(height: float, width: float = WIDTH) -> Figure:
    """A figure [in] that spaces its panels by itself."""
    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Figure, path: str | Path) -> None:
    """Write an SVG without a date, under a temporary name first. Dense layers become pixels where it would exceed MAX_BYTES."""
    _settle(figure)
    data = _svg(figure)
    if len(data) > MAX_BYTES:
        for axes in figure.findobj(Axes):
            for artist in [*axes.lines, *axes.collections]:
                artist.set_rasterized(_points(artist) > 50)
        data = _svg(figure)
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    temporary.write_bytes(data)
    temporary.replace(target)


def _settle(figure: Figure) -> None:
    """Space the panels once and round where they stand: the solver's last digits differ from run to run."""
    with rc_context(_RC):
        figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes in figure.findobj(Axes):
        left, bottom, width, height = (round(v, 4) for v in axes.get_position(original=True).bounds)
        axes.set_position((left, bottom, width, height))
    for text in figure.texts:
        text.set_position((round(text.get_position()[0], 4), round(text.get_position()[1], 4)))


def _svg(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    with rc_context(_RC):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def _points(artist: Artist) -> int:
    """Corners that an artist would leave in a vector file."""
    if isinstance(artist, Line2D):
        return int(np.size(artist.get_xdata()))
    if isinstance(artist, Collection):
        return max(sum(int(np.shape(p.vertices)[0]) for p in artist.get_paths()), int(np.atleast_2d(artist.get_offsets()).shape[0]))
    return 0


# -- honest panels ----------------------------------------------------------------------------------------------------


def blank(axes: Axes, reason: str) -> None:
    """Say in a panel why it is empty."""
    axes.set(xticks=[], yticks=[])
    axes.set_facecolor("#f7f7f7")
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.text(0.5, 0.5, reason, transform=axes.transAxes, ha="center", va="center", wrap=True, color="#555555", fontsize=7.5)


def empty(title: str, reason: str) -> Figure:
    """A figure with nothing to draw, and why."""
    figure = page(1.6)
    axes = figure.subplots()
    axes.set_title(plain(title))
    blank(axes, plain(reason))
    return figure


def footnote(figure: FigureBase, words: str) -> None:
    """A line below the figure: what is not shown, and where it is."""
    if words:
        figure.supxlabel(plain(words), x=0.01, ha="left", fontsize=7, color="#555555")


def plain(text: str) -> str:
    """Text for a figure: a dollar sign in a file name starts no formula."""
    return text.replace("$", r"\$")


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names in a row; the rest counted."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def not_drawn(names: Sequence[str], where: str) -> str:
    """Sentence on subjects that a figure leaves out; empty where it leaves out none."""
    return f"Not drawn: {listed(names)}; their rows are in {where}." if names else ""


# -- lines ------------------------------------------------------------------------------------------------------------


def thin(time: Array, y: Array, bins: int = POINTS) -> tuple[Array, Array]:
    """Keep the lowest and the highest sample of each bin: the line looks the same, the file stays small.

    time, y: shape (n,). Returns samples of the table, in order; a bin without any value keeps one NaN, so that gaps stay gaps.
    """
    n = len(y)
    if n <= 2 * bins:
        return time, y
    edges = np.linspace(0, n, bins + 1).astype(int)
    keep: list[int] = []
    for start, end in pairwise(edges):
        part = y[start:end]
        if np.isnan(part).all():
            keep.append(start)
        else:
            keep += sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))})
    return time[keep], y[keep]


def difference(x: Array, time: Array) -> Array:
    """Central difference over 2 STEP [m/s], shape (n,), NaN at the ends and beside gaps.  x [m], time [s]: shape (n,)."""
    k = max(1, round(STEP / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    out = np.full(len(x), np.nan)
    if len(x) > 2 * k:
        out[k:-k] = (x[2 * k :] - x[: -2 * k]) / (time[2 * k :] - time[: -2 * k])
    return out


def line(axes: Axes, time: Array, y: Array, colour: str, label: str = "", width: float = 1.0, style: str = "-") -> bool:
    """Draw a thinned line where there is any finite value; returns whether there was."""
    if not np.isfinite(y).any():
        return False
    axes.plot(*thin(time, y), style, color=colour, lw=width, label=label or None)
    return True


def rows(table: pd.DataFrame) -> Iterator[Any]:
    """The rows of a table, columns as attributes."""
    yield from table.itertuples(index=False)


def shade(axes: Axes, spans: pd.DataFrame) -> None:
    """Shade the pushes of a trial."""
    for start, end in zip(spans["start"], spans["end"], strict=True):
        axes.axvspan(start, end, color=PUSH, lw=0, zorder=0)
