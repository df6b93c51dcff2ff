"""Linked views of the residuals: what is selected in one is lit in the others. Bokeh, inline; nothing is fetched."""

import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import bokeh.models
import numpy as np
import pandas as pd
from bokeh.document import Document
from bokeh.layouts import gridplot
from bokeh.plotting import figure
from bokeh.resources import Resources
from numpy.typing import NDArray

models: Any = bokeh.models  # its classes take properties that no type checker sees

MOST = 4000  # points per axis
FINEST, COARSEST = 16.0, 4.0  # samples per half width of the bump; the residuals cannot change faster than the coarsest shows
GAP = 1.0  # [s] between trials that are laid end to end
MEASURED, MODEL, RESIDUAL = "#111111", "#0b61a4", "#d95f02"
SIGNED = ["#4b2a7b", "#7d66a5", "#b9a8d4", "#ddd6e6", "#eeeeee", "#f7d9bd", "#f6b27a", "#d95f02", "#8f3f00"]
LETTER = {"lateral": "x", "forward": "y"}
COLUMNS = [
    "trial", "subject", "axis", "time", "com", "velocity", "zmp", "zmp_model", "error", "r_force",
]  # fmt: skip
"""Columns of `residuals` that the views read."""


class Linked(NamedTuple):
    """documents: JSON, axis -> Bokeh's document.  roots: axis -> [(id of the root, id of its element, kind)].  note: what is shown."""

    documents: str
    roots: dict[str, list[tuple[str, str, str]]]
    note: str


def linked(residuals: pd.DataFrame, where: pd.DataFrame, half_width: float) -> Linked:
    """Phase plane, model against measurement and three courses over time for each axis that was judged.

    residuals: rows of the first part, at least COLUMNS.  where: tells how many trials there are.  half_width: of the bump [s].
    """
    judged = residuals[np.isfinite(residuals["error"])]
    if judged.empty:
        return Linked("", {}, "No trial could be left out and judged, so there is nothing to explore.")
    documents: dict[str, Any] = {}
    roots: dict[str, list[tuple[str, str, str]]] = {}
    notes = []
    for axis in (a for a in LETTER if (judged["axis"] == a).any()):
        mine = judged[judged["axis"] == axis]
        step = spacing(mine, half_width)
        points, trials = chosen(mine, step)
        documents[axis], names = _document(views := list(_views(points, axis)), axis)
        roots[axis] = [(names[root.id], f"linked-{axis}-{kind}", kind) for root, kind in views]
        total = int(((where["view"] == "trial") & (where["axis"] == axis)).sum())
        notes.append(f"{axis}: {len(points)} samples, {1e3 * step:.0f} ms apart, of {trials} of {total} judged trials")
    # the order of keys matters to Bokeh: a model is defined where it is named first
    text = json.dumps(documents, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Linked(text, roots, f"Shown are, {'; '.join(notes)}.")


def javascript() -> str:
    """Bokeh's own script. The two addresses it could load things from (formulas, maps; unused here) are taken out."""
    raw = "\n".join(Resources(mode="inline", components=["bokeh"], log_level="warn").js_raw)
    return re.sub(r"https://(cdn\.jsdelivr\.net|maps\.googleapis\.com)", "about:invalid#", raw)


# -- samples ----------------------------------------------------------------------------------------------------------


def spacing(judged: pd.DataFrame, half_width: float) -> float:
    """Time between samples [s] such that all trials fit, within FINEST and COARSEST.  judged: rows of one axis with a finite error."""
    time = judged.groupby("trial", observed=True)["time"]
    frame = float((time.max() - time.min()).sum() / max(len(judged) - time.ngroups, 1))  # gaps included: never too fine
    return float(np.clip(len(judged) * frame / MOST, half_width / FINEST, half_width / COARSEST))


def chosen(judged: pd.DataFrame, step: float) -> tuple[pd.DataFrame, int]:
    """Samples of one axis, at most MOST: every trial thinned to one per `step` [s]; trials in turns over the subjects until full.

    judged: rows with a finite error.  Returns the samples, positions from the trial's medians, with `shift`, time with the trials laid
    end to end; and the number of trials.
    """
    names = judged[["subject", "trial"]].drop_duplicates().sort_values(["subject", "trial"])
    order = names.assign(turn=names.groupby("subject").cumcount()).sort_values(["turn", "subject"])
    rows = judged.groupby("trial", observed=True).indices
    kept: list[pd.DataFrame] = []
    room, begin = MOST, 0.0
    for trial in order["trial"]:
        one = judged.iloc[rows[trial]].sort_values("time")
        one = one.iloc[_spaced(one["time"].to_numpy(), step)]
        if kept and len(one) > room:
            break
        one = one.iloc[:MOST]
        time = one["time"].to_numpy()
        kept.append(_placed(one, time - time[0] + begin))
        begin += float(time[-1] - time[0]) + GAP
        room -= len(one)
    return pd.concat(kept, ignore_index=True), len(kept)


def _placed(one: pd.DataFrame, shift: NDArray[np.float64]) -> pd.DataFrame:
    """A trial's samples with CoM and ZMP counted from its medians: walkers and people on other plates then share one scale."""
    middle = one["zmp"].median()
    centred = {"com": one["com"] - one["com"].median(), "zmp": one["zmp"] - middle, "zmp_model": one["zmp_model"] - middle}
    return one.assign(shift=shift, **centred)


def _spaced(time: NDArray[np.float64], step: float) -> NDArray[np.int64]:
    """First sample in each interval of `step` [s]."""
    return np.unique(np.floor((time - time[0]) / step + 1e-6), return_index=True)[1]


# -- views ------------------------------------------------------------------------------------------------------------


def _views(points: pd.DataFrame, axis: str) -> Iterator[tuple[Any, str]]:
    source = _source(points)
    c = LETTER[axis]
    yield _phase(source, c), "phase"
    yield _against(source, c), "against"
    yield _courses(source, c), "courses"


def _source(points: pd.DataFrame) -> Any:
    scaled = {
        "t": points["shift"], "time": points["time"], "x": points["com"], "v": points["velocity"], "zmp": 1e3 * points["zmp"],
        "model": 1e3 * points["zmp_model"], "error": 1e3 * points["error"], "force": points["r_force"],
    }  # fmt: skip
    data: dict[str, Any] = {k: np.asarray(v, dtype=np.float32) for k, v in scaled.items()}
    return models.ColumnDataSource({**data, "trial": points["trial"].astype(str).tolist()})


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


def _phase(source: Any, c: str) -> Any:
    error = np.abs(source.data["error"])
    reach = float(np.quantile(error, 0.98)) or 1.0
    mapper = models.LinearColorMapper(palette=SIGNED, low=-reach, high=reach)
    plot = _plot(source, "Phase plane, coloured by the error", f"CoM from its median, {c} [m]", f"velocity of {c} [m/s]", 360)
    _dots(plot, source, "x", "v", {"field": "error", "transform": mapper}, 5.0)
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


def _courses(source: Any, c: str) -> Any:
    zmp = _plot(source, "ZMP, measured (black) and modelled (blue)", "", f"{c} from its median [mm]", 190)
    _dots(zmp, source, "t", "zmp", MEASURED, 3.5)
    _dots(zmp, source, "t", "model", MODEL, 2.5)
    error = _plot(source, "Error: the model's equation in mm of ZMP", "", "[mm]", 170, x_range=zmp.x_range)
    _dots(error, source, "t", "error", RESIDUAL)
    force = _plot(
        source, "rF: acceleration of the CoM less horizontal force over mass (the kinematic side alone)",
        "time, trials end to end [s]", "[m/s\u00b2]", 190, x_range=zmp.x_range,
    )  # fmt: skip
    if np.isfinite(source.data["force"]).any():
        _dots(force, source, "t", "force", RESIDUAL)
    else:
        force.title.text += ": not known, no shear"
    for plot in (error, force):
        plot.add_layout(models.Span(location=0, dimension="width", line_color="#bbbbbb", line_width=1, level="underlay"))
    return gridplot([[zmp], [error], [force]], merge_tools=True, toolbar_location="right", sizing_mode="stretch_width")


# -- ids that do not depend on what else this process drew ------------------------------------------------------------


def _document(views: list[tuple[Any, str]], axis: str) -> tuple[Any, dict[str, str]]:
    """The views as one document in plain dicts and lists; its models numbered as they stand in it, and the new name of each."""
    document = Document()
    for root, _ in views:
        document.add_root(root)
    names: dict[str, str] = {}

    def walk(node: Any) -> Any:
        if isinstance(node, dict):
            if isinstance(node.get("id"), str) and (set(node) == {"id"} or node.get("type") == "object"):
                node = {**node, "id": names.setdefault(node["id"], f"{axis}{len(names)}")}
            return {k: v if k == "id" else walk(v) for k, v in node.items()}
        return [walk(v) for v in node] if isinstance(node, (list, tuple)) else node

    return walk(document.to_json(deferred=False)), names
