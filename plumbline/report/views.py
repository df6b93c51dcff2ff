"""The linked views of one axis. All read one source, so that what is selected in one is lit in the others."""

from collections.abc import Mapping
from typing import Any

import bokeh.models
import numpy as np
import pandas as pd
from bokeh.layouts import gridplot
from bokeh.plotting import figure
from numpy.typing import NDArray

from plumbline.effects import Effect

models: Any = bokeh.models  # its classes take properties that no type checker sees
Added = Mapping[str, NDArray[np.float64]]

MEASURED, MODEL, RESIDUAL = "#111111", "#0b61a4", "#d95f02"
SIGNED = ["#4b2a7b", "#7d66a5", "#b9a8d4", "#ddd6e6", "#eeeeee", "#f7d9bd", "#f6b27a", "#d95f02", "#8f3f00"]
LETTER = {"lateral": "x", "forward": "y"}
MOST = 8  # panels of rungs, and of effects
STRIP = 13  # [px] height of a trial's strip
LETTERS = 24  # of a trial's name


def views(points: pd.DataFrame, more: Added, axis: str, effects: Mapping[str, Effect]) -> list[tuple[Any, str]]:
    """Roots of the document with their kinds.

    points: samples, see :func:`plumbline.report.linked.chosen`.  more: errors after each rung and what each effect adds [m], (n,) each.
    effects: the catalogue, for titles.
    """
    source, c = _source(points, more), LETTER[axis]
    mapper = _mapper(source)
    return [
        (_phase(source, c, mapper), "phase"),
        (_against(source, c), "against"),
        (_strips(source, mapper), "strips"),
        (_courses(source, c, more, effects), "courses"),
    ]


def columns(more: Added) -> dict[str, str]:
    """Column of the source -> name among what was added: rungs as they come, effects by what they add, the most first."""
    rungs = [n for n in more if n.startswith("after ")]
    effects = sorted((n for n in more if n.startswith("effect ")), key=lambda n: (-rms(more[n]), n))
    return {f"{kind}{i}": n for kind, names in (("after", rungs), ("effect", effects)) for i, n in enumerate(names[:MOST])}


def rms(values: NDArray[np.float64]) -> float:
    """Root mean square of what is known; 0 where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def said(name: str, effects: Mapping[str, Effect]) -> str:
    """An added column in words."""
    kind, what = name.split(" ", 1)
    if kind == "after":
        return what
    return f"{effects[what].title} ({what})" if what in effects else what


def _source(points: pd.DataFrame, more: Added) -> Any:
    scaled = {
        "t": points["shift"], "time": points["time"], "x": points["com"], "v": points["velocity"], "zmp": 1e3 * points["zmp"],
        "model": 1e3 * points["zmp_model"], "error": 1e3 * points["error"], "force": points["r_force"],
        "within": points["time"] - points.groupby("trial", observed=True)["time"].transform("min"),
        "row": pd.factorize(points["trial"])[0],
    }  # fmt: skip
    scaled |= {key: 1e3 * more[name] for key, name in columns(more).items()}
    data: dict[str, Any] = {k: np.asarray(v, dtype=np.float32) for k, v in scaled.items()}
    return models.ColumnDataSource({**data, "trial": points["trial"].astype(str).tolist()})


def _mapper(source: Any) -> Any:
    """Colours of the error, the same in all views and for each rung."""
    reach = float(np.quantile(np.abs(source.data["error"]), 0.98)) or 1.0
    return models.LinearColorMapper(palette=SIGNED, low=-reach, high=reach, nan_color="#ffffff00")


def _plot(source: Any, title: str, x: str, y: str, height: int, **more: Any) -> Any:
    plot: Any = figure(
        title=title, x_axis_label=x, y_axis_label=y, height=height, sizing_mode="stretch_width", min_width=250, output_backend="canvas",
        tools="box_select,lasso_select,box_zoom,pan,wheel_zoom,reset", active_drag="box_select", active_scroll=None, **more,
    )  # fmt: skip
    plot.toolbar.logo = None
    plot.toolbar.autohide = False
    plot.select(models.BoxSelectTool).continuous = False
    plot.xgrid.grid_line_color = plot.ygrid.grid_line_color = "#efefef"
    plot.outline_line_color = None
    for axis in (*plot.xaxis, *plot.yaxis):
        axis.axis_label_text_font_style = "normal"
        axis.axis_line_color = axis.major_tick_line_color = "#666666"
        axis.minor_tick_line_color = None
    said = [("trial", "@trial"), ("time", "@time{0.00} s"), ("error", "@error{0.00} mm")]
    plot.add_tools(models.HoverTool(tooltips=said, point_policy="snap_to_data"))
    return plot


def _dots(plot: Any, source: Any, x: str, y: str, color: Any, size: float = 3.0, **more: Any) -> None:
    plot.scatter(
        x, y, source=source, size=size, color=color, line_color=None, alpha=0.85, nonselection_alpha=0.07, selection_alpha=1.0, **more
    )


def _phase(source: Any, c: str, mapper: Any) -> Any:
    plot = _plot(source, "Phase plane, coloured by the error", f"CoM from its median, {c} [m]", f"velocity of {c} [m/s]", 360)
    _dots(plot, source, "x", "v", {"field": "error", "transform": mapper}, 5.0, name="coloured")
    plot.add_layout(models.ColorBar(color_mapper=mapper, width=8, padding=4, title="mm", title_text_font_style="normal"), "right")
    return plot


def _against(source: Any, c: str) -> Any:
    both = np.concatenate([source.data["zmp"], source.data["model"]])
    low, high = float(both.min()), float(both.max())
    room = 0.04 * (high - low) or 1.0
    span = {"x_range": models.Range1d(low - room, high + room), "y_range": models.Range1d(low - room, high + room)}
    labels = f"measured ZMP, {c} from its median [mm]", f"modelled ZMP, {c} from the same [mm]"
    plot = _plot(source, "Model against measurement", *labels, 360, **span)
    plot.add_layout(models.Slope(gradient=1, y_intercept=0, line_color=MEASURED, line_width=1))
    _dots(plot, source, "zmp", "model", MODEL)
    return plot


def _strips(source: Any, mapper: Any) -> Any:
    """A strip per trial, coloured as the phase plane."""
    names = list(dict.fromkeys(source.data["trial"]))
    span = {"y_range": models.Range1d(len(names) - 0.4, -0.6)}
    plot = _plot(source, "Trial by trial, coloured by the error", "time within the trial [s]", "", 125 + STRIP * len(names), **span)
    plot.toolbar_location = "above"  # it may be too low for a column of tools
    plot.yaxis.ticker = models.FixedTicker(ticks=list(range(len(names))))
    plot.yaxis.major_label_overrides = {i: n if len(n) <= LETTERS else f"\u2026{n[1 - LETTERS :]}" for i, n in enumerate(names)}
    plot.yaxis.major_label_text_font_size = "10px"
    plot.yaxis.major_tick_line_color = None
    plot.ygrid.grid_line_color = None
    _dots(plot, source, "within", "row", {"field": "error", "transform": mapper}, 7.0, marker="square", name="coloured")
    return plot


def _courses(source: Any, c: str, more: Added, effects: Mapping[str, Effect]) -> Any:
    zmp = _plot(source, "ZMP, measured (black) and modelled (blue)", "", f"{c} from its median [mm]", 190)
    _dots(zmp, source, "t", "zmp", MEASURED, 3.5)
    _dots(zmp, source, "t", "model", MODEL, 2.5)
    error = _plot(source, "Error: the model's equation in mm of ZMP", "", "[mm]", 170, x_range=zmp.x_range)
    _dots(error, source, "t", "error", RESIDUAL)
    panels = [zmp, error]
    for key, name in columns(more).items():
        words = said(name, effects)
        after = key.startswith("after")
        title = f"Error that is left with {words}" if after else f"{words}: what it adds, in mm of ZMP (rms {1e3 * rms(more[name]):.2g} mm)"
        span = {"y_range": error.y_range} if after else {}  # on one scale the fall is seen
        plot = _plot(source, title.replace("with + ", "with "), "", "[mm]", 130, x_range=zmp.x_range, **span)
        _dots(plot, source, "t", key, RESIDUAL if after else MODEL)
        panels.append(plot)
    panels.append(_force(source, zmp.x_range))
    for plot in panels[1:]:
        plot.add_layout(models.Span(location=0, dimension="width", line_color="#bbbbbb", line_width=1, level="underlay"))
    panels[-1].xaxis.axis_label = "time, trials end to end [s]"
    return gridplot([[p] for p in panels], merge_tools=True, toolbar_location="right", sizing_mode="stretch_width")


def _force(source: Any, time: Any) -> Any:
    title = "rF: acceleration of the CoM less horizontal force over mass (the kinematic side alone)"
    plot = _plot(source, title, "", "[m/s\u00b2]", 190, x_range=time)
    if np.isfinite(source.data["force"]).any():
        _dots(plot, source, "t", "force", RESIDUAL)
    else:
        plot.title.text += ": not known, no shear"
    return plot
