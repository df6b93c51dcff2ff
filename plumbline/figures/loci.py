"""Phase portrait of all loci, as Fig. 5 of Murai 2013: velocity of the CoM over its distance from the reference."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from plumbline.figures import _style as s

MOST = 8  # subjects on a page
POINTS = 200  # bins per locus
SHORT = 8.0  # [s] a locus rests near the reference later on; drawn up to here

KINDS: dict[str, tuple[Any, str, float]] = {
    "recovering": ("-", s.MEASURED, 0.7),
    "recovering_from_beyond": ((0, (5, 1.5)), s.MEASURED, 0.9),
    "falling": ("-", s.MEASURED_TOO, 0.9),
    "unrecovered": ((0, (1.2, 1.2)), s.MEASURED_TOO, 0.9),
}
ENDS = {"falling": "x", "unrecovered": "o"}


@s.styled
def draw(signals: pd.DataFrame, loci: pd.DataFrame, fit: pd.DataFrame) -> Figure:
    """One panel per subject, lateral axis.

    signals, loci, fit: tables of a part. Drawn are `com_x` - `reference` and its central difference between the frames of each locus
    (unfiltered: a low-pass would smear the push into the locus), and the lines x + x'/w = support limit (blue: w is the model's)
    between which a locus can still be brought back.
    """
    if loci.empty:
        trials = signals["trial"].nunique()
        return s.empty("Phase portrait of all loci", f"no locus in the {trials} trials of this part: nobody was pushed or released")
    subjects = sorted(loci["subject"].unique())
    shown = subjects[:MOST]
    columns = min(len(shown), 2)
    rows = -(-len(shown) // columns)
    figure = s.page(4.6 if columns == 1 else 0.5 + 3.2 * rows)
    panels = figure.subplots(rows, columns, squeeze=False)
    for axes, subject in zip(panels.flat, shown, strict=False):
        mine = [t[t["subject"] == subject] for t in (signals, loci, fit)]
        _panel(axes, subject, *mine)
    for axes in panels.flat[len(shown) :]:
        axes.set_axis_off()
    figure.legend(handles=_keys(loci), loc="outside upper left", ncols=3, columnspacing=1.5)
    s.footnote(figure, _note(loci, subjects[MOST:]))
    return figure


def _panel(axes: Axes, subject: str, signals: pd.DataFrame, loci: pd.DataFrame, fit: pd.DataFrame) -> None:
    by_trial = dict(tuple(signals.groupby("trial", observed=True)))
    for locus in s.rows(loci):
        frames = by_trial.get(locus.trial)
        if frames is not None:
            _draw_locus(axes, frames, locus)
    axes.axhline(0, color=s.FAINT, lw=0.6, zorder=0)
    axes.axvline(0, color=s.FAINT, lw=0.6, zorder=0)
    _limits(axes, signals, loci, fit)
    axes.set(xlabel="CoM from its reference $x - x_0$ [m], right positive", ylabel=r"velocity $\dot{x}$ [m/s]")
    counts = loci["side"].value_counts()
    sides = ", ".join(f"{n} to the {side}" for side, n in sorted(counts.items()))
    axes.set_title(s.plain(f"{subject}: {len(loci)} loci ({sides})"))


def _draw_locus(axes: Axes, frames: pd.DataFrame, locus: Any) -> None:
    number, time = frames["frame"].to_numpy(), frames["time"].to_numpy(float)
    x = frames["com_x"].to_numpy(float) - locus.reference
    v = s.difference(x, time)
    inside = (number >= locus.start_frame) & (number <= locus.end_frame) & (time <= locus.start + SHORT)
    good = np.flatnonzero(inside & np.isfinite(x) & np.isfinite(v))
    if not len(good):
        return
    keep = good[np.unique(np.linspace(0, len(good) - 1, min(len(good), POINTS)).astype(int))]
    style, colour, width = KINDS[locus.kind]
    axes.plot(x[keep], v[keep], linestyle=style, color=colour, lw=width)
    axes.plot(x[keep[0]], v[keep[0]], ".", color=colour, ms=3.5)
    if locus.kind in ENDS:
        axes.plot(x[keep[-1]], v[keep[-1]], ENDS[locus.kind], color=colour, ms=4, mfc="none")


def _limits(axes: Axes, signals: pd.DataFrame, loci: pd.DataFrame, fit: pd.DataFrame) -> None:
    """Lines x + x'/w = limit, clipped to what the loci span."""
    w = omega(fit)
    reference = loci["reference"].median()
    limits = [signals[f"limit_{side}"].median() - reference for side in ("left", "right")]
    axes.autoscale_view()
    span = axes.get_xlim(), axes.get_ylim()
    speed = np.array(span[1])
    for limit in limits:
        if np.isfinite(limit):
            axes.axvline(limit, color=s.MEASURED_TOO, lw=0.7, ls="-.", zorder=0.5)
            axes.plot(limit - speed / w, speed, color=s.MODEL, lw=1.1, zorder=0.6)
    if np.isfinite([*limits, w]).all():
        axes.fill_betweenx(speed, limits[0] - speed / w, limits[1] - speed / w, color=s.RECOVERABLE, lw=0, zorder=-1)
    axes.set(xlim=_with(span[0], limits), ylim=span[1])


def omega(fit: pd.DataFrame) -> float:
    """Natural frequency of a subject, lateral [rad/s]; NaN where it was not found."""
    chosen = fit[(fit["level"] == "subject") & (fit["axis"] == "lateral")]
    return float(chosen["omega"].iloc[0]) if len(chosen) else float("nan")


def _with(span: tuple[float, float], limits: list[float]) -> tuple[float, float]:
    """The span, widened to the support where that is not far away."""
    known = [v for v in limits if np.isfinite(v) and abs(v) < 3 * max(abs(span[0]), abs(span[1]))]
    room = 0.03 * (span[1] - span[0])
    return min([span[0], *(v - room for v in known)]), max([span[1], *(v + room for v in known)])


def _keys(loci: pd.DataFrame) -> list[Line2D]:
    counts = loci["kind"].value_counts()
    keys = [
        Line2D([], [], linestyle=style, color=colour, lw=width, marker=ENDS.get(kind, ""), mfc="none", ms=4,
               label=f"{kind.replace('_', ' ')} ({counts[kind]})")
        for kind, (style, colour, width) in KINDS.items() if kind in counts
    ]  # fmt: skip
    keys.append(Line2D([], [], color=s.MODEL, lw=1.1, label=r"$x + \dot{x}/\omega$ = support limit"))
    keys.append(Line2D([], [], color=s.MEASURED_TOO, lw=0.7, ls="-.", label="support limit"))
    return keys


def _note(loci: pd.DataFrame, left_out: list[str]) -> str:
    said = ["Dots: where a locus begins."]
    if (loci["end"] - loci["start"] > SHORT).any():
        said.append(f"Loci are drawn for their first {SHORT:.0f} s.")
    return " ".join([*said, s.not_drawn(left_out, "results/loci")]).strip()
