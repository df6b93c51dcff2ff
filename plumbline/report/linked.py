"""Samples of the linked views and their document: what is selected in one view is lit in the others. Nothing is fetched."""

import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from bokeh.document import Document
from bokeh.resources import Resources
from numpy.typing import NDArray

from plumbline.effects import Effect
from plumbline.report import views

MOST = 4000  # points per axis
FINEST, COARSEST = 16.0, 4.0  # samples per half width of the bump; the residuals cannot change faster than the coarsest shows
NEAR = 1.5  # usual distances between windows, beyond which nothing is drawn between them
GAP = 1.0  # [s] between trials that are laid end to end
COLUMNS = [
    "trial", "subject", "axis", "frame", "time", "com", "velocity", "zmp", "zmp_model", "error", "r_force",
]  # fmt: skip
"""Columns of `residuals` that the views read."""


class Linked(NamedTuple):
    """documents: JSON, axis -> Bokeh's document.  roots: axis -> [(id of the root, id of its element, kind)].  note: what is shown.

    errors: axis -> [(column, words)], the errors by which the phase plane can be coloured.
    """

    documents: str
    roots: dict[str, list[tuple[str, str, str]]]
    note: str
    errors: dict[str, list[tuple[str, str]]]


def linked(
    residuals: pd.DataFrame, where: pd.DataFrame, half_width: float, contributions: pd.DataFrame | None = None,
    effects: Mapping[str, Effect] | None = None,
) -> Linked:  # fmt: skip
    """Phase plane, model against measurement, trial by trial, and courses over time for each axis that was judged.

    residuals: rows of the first part, at least COLUMNS.  where: tells how many trials there are.  half_width: of the bump [s].
    contributions: of the first part, for the errors after each rung and what each effect adds.  effects: the catalogue, for titles.
    """
    judged = residuals[np.isfinite(residuals["error"])]
    if judged.empty:
        return Linked("", {}, "No trial could be left out and judged, so there is nothing to explore.", {})
    documents: dict[str, Any] = {}
    roots: dict[str, list[tuple[str, str, str]]] = {}
    errors: dict[str, list[tuple[str, str]]] = {}
    notes = []
    for axis in (a for a in views.LETTER if (judged["axis"] == a).any()):
        mine = judged[judged["axis"] == axis]
        step = spacing(mine, half_width)
        points, trials = chosen(mine, step)
        more = added(points, contributions[contributions["axis"] == axis]) if contributions is not None else {}
        shown = views.views(points, more, axis, effects or {})
        documents[axis], names = _document(shown, axis)
        roots[axis] = [(names[root.id], f"linked-{axis}-{kind}", kind) for root, kind in shown]
        errors[axis] = [
            ("error", "the paper's equation"),
            *((k, views.said(n, {})) for k, n in views.columns(more).items() if k.startswith("after")),
        ]
        total = int(((where["view"] == "trial") & (where["axis"] == axis)).sum())
        notes.append(f"{axis}: {len(points)} samples, {1e3 * step:.0f} ms apart, of {trials} of {total} judged trials")
    # the order of keys matters to Bokeh: a model is defined where it is named first
    text = json.dumps(documents, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return Linked(text, roots, f"Shown are, {'; '.join(notes)}.", errors)


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


def added(points: pd.DataFrame, contributions: pd.DataFrame) -> dict[str, NDArray[np.float64]]:
    """Columns of `contributions` at the samples [m], name -> (n,), NaN where no window is near; columns without a value are left out.

    points: samples of one axis.  contributions: rows of the same axis; between two neighbouring windows they are straight lines.
    """
    names = [c for c in contributions.columns if c.startswith(("after ", "effect "))]
    out = {name: np.full(len(points), np.nan) for name in names}
    places = points.reset_index(drop=True).groupby("trial", observed=True).indices
    for trial, rows in contributions.groupby("trial", observed=True):
        at = places.get(trial)
        if at is None or len(rows) < 2:
            continue
        ordered = rows.sort_values("frame")
        frame, here = ordered["frame"].to_numpy(float), points["frame"].to_numpy(float)[at]
        after = np.clip(np.searchsorted(frame, here), 1, len(frame) - 1)
        near = (frame[after] - frame[after - 1] <= NEAR * np.median(np.diff(frame))) & (here >= frame[0]) & (here <= frame[-1])
        for name in names:
            out[name][at] = np.where(near, np.interp(here, frame, ordered[name].to_numpy(float)), np.nan)
    return {name: values for name, values in out.items() if np.isfinite(values).any()}


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
