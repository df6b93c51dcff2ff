"""From the raw recording to the CoM, for one trial: forces, CoP, CoM and the acceleration that both must agree on."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from plumbline.figures import _style as s

LONGEST = 60.0  # [s] of a trial that are drawn
HORIZONTAL = {"lateral": "to the right", "forward": "forward"}


@s.styled
def draw(signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame) -> Figure:
    """Both axes of one trial of a part.

    signals, pushes, coverage: tables of the part.  Drawn is the first trial with a CoM (best: from the segments) and a push, else
    with a CoM, else the first.
    """
    about = example(coverage, pushes)
    rows = signals.iloc[:0] if about is None else signals[signals["trial"] == about["trial"]]
    if about is None or rows.empty:
        return s.empty("From the recording to the CoM", "no trial of this part could be used; the exclusions say why")
    begin = rows["time"].iloc[0]
    shown = rows[rows["time"] <= begin + LONGEST]
    figure = s.page(6.4)
    panels = figure.subplots(4, 2, sharex=True)
    spans = pushes[(pushes["trial"] == about["trial"]) & (pushes["start"] <= begin + LONGEST)]
    for column, axis in enumerate(s.LETTER):
        _column(panels[:, column], shown, about, axis)
    for axes in panels.flat:
        s.shade(axes, spans)
    for axes in panels[-1]:
        axes.set_xlabel("time $t$ [s]")
    panels[0, 0].set_xlim(begin, shown["time"].iloc[-1])
    figure.suptitle(s.plain(f"{about['trial']}: {_method(about)}"), x=0.01, ha="left", fontsize=9)
    s.footnote(figure, _note(rows, shown, spans, len(coverage)))
    return figure


def example(coverage: pd.DataFrame, pushes: pd.DataFrame) -> pd.Series | None:
    """The trial that is drawn: its row of `coverage`; None where there is none."""
    ordered = coverage.sort_values("trial", kind="stable")
    best = ordered[ordered["com_method"] == "table"]
    with_com = best if len(best) else ordered[ordered["com_method"] != "none"]
    for choice in (with_com[with_com["trial"].isin(pushes["trial"])], with_com, ordered):
        if len(choice):
            return choice.iloc[0]
    return None


def _method(about: pd.Series) -> str:
    if about["com_method"] == "none":
        return f"no CoM ({about['limitation']})" if about["limitation"] else "no CoM"
    said = {"table": "CoM from the segment table", "lab": "CoM as the file holds it", "force": "CoM integrated from the force"}
    text = said[about["com_method"]]
    if about["com_method"] == "table":
        text += f" ({about['marker_set']}, {100 * about['mass_share']:.0f} % of body mass)"
    return f"{text}, {about['mass']:.1f} kg" if about["mass"] == about["mass"] else text


def _note(rows: pd.DataFrame, shown: pd.DataFrame, spans: pd.DataFrame, trials: int) -> str:
    whole = rows["time"].iloc[-1] - rows["time"].iloc[0]
    said = [f"Shaded: {len(spans)} push windows." if len(spans) else "No push was marked or found here."]
    if len(shown) < len(rows):
        said.append(f"The first {LONGEST:.0f} s of {whole:.0f} s.")
    filled = int(rows["filled"].sum())
    if filled:
        said.append(f"In {filled} of {len(rows)} frames a marker was filled across a gap.")
    if trials > 1:
        said.append(f"One of the {trials} trials of this part.")
    return " ".join(said)


def _column(panels: s.Panels, rows: pd.DataFrame, about: pd.Series, axis: str) -> None:
    c = s.LETTER[axis]
    panels[0].set_title(f"{axis} axis ({c}, {HORIZONTAL[axis]})")
    _horizontal(panels[0], rows, c)
    if axis == "lateral":
        _vertical(panels[1], rows)
    else:
        _height(panels[1], rows)
    _position(panels[2], rows, axis)
    _acceleration(panels[3], rows, about, c)


def _horizontal(axes: Axes, rows: pd.DataFrame, c: str) -> None:
    axes.set_ylabel(f"force $F_{c}$ [N]")
    if not s.line(axes, _t(rows), _v(rows, f"grf_{c}"), s.MEASURED, width=0.7):
        s.blank(axes, f"no horizontal force $F_{c}$ in this recording")


def _vertical(axes: Axes, rows: pd.DataFrame) -> None:
    axes.set_ylabel("force $F_z$ [N]")
    any_ = s.line(axes, _t(rows), _v(rows, "grf_z"), s.MEASURED, "net", 0.8)
    any_ |= s.line(axes, _t(rows), _v(rows, "grf_left_z"), s.MEASURED_TOO, "left foot", 0.7)
    any_ |= s.line(axes, _t(rows), _v(rows, "grf_right_z"), s.MEASURED_TOO, "right foot", 0.7, "--")
    _legend(axes) if any_ else s.blank(axes, "no vertical force in this recording")


def _height(axes: Axes, rows: pd.DataFrame) -> None:
    axes.set_ylabel("CoM height $z$ [m]")
    if not s.line(axes, _t(rows), _v(rows, "com_z"), s.MEASURED, width=0.8):
        s.blank(axes, "no height of the CoM")


def _position(axes: Axes, rows: pd.DataFrame, axis: str) -> None:
    c = s.LETTER[axis]
    axes.set_ylabel(f"position ${c}$ [m]")
    sides = ("left", "right") if axis == "lateral" else ("back", "front")
    for label, side in zip(("support", ""), sides, strict=True):
        s.line(axes, _t(rows), _v(rows, f"limit_{side}"), s.SUPPORT, label, 0.8)
    any_ = s.line(axes, _t(rows), _v(rows, f"zmp_{c}"), s.MEASURED_TOO, "ZMP", 0.7)
    any_ |= s.line(axes, _t(rows), _v(rows, f"com_{c}"), s.MEASURED, "CoM", 1.2)
    if not _same(rows, f"com_{c}", f"com_lab_{c}"):
        any_ |= s.line(axes, _t(rows), _v(rows, f"com_lab_{c}"), s.MEASURED, "CoM in the file", 0.8, ":")
    _legend(axes) if any_ else s.blank(axes, "neither CoM nor ZMP")


def _acceleration(axes: Axes, rows: pd.DataFrame, about: pd.Series, c: str) -> None:
    axes.set_ylabel(rf"$\ddot{{{c}}}$ [m/s$^2$]")
    any_ = s.line(axes, _t(rows), _v(rows, f"grf_{c}") / about["mass"], s.MEASURED_TOO, f"$F_{c}/m$", 0.6)
    cutoff = f", {about['cutoff']:g} Hz" if about["cutoff"] == about["cutoff"] else ""
    any_ |= s.line(axes, _t(rows), _v(rows, f"com_ddot_{c}"), s.MEASURED, "CoM, low-passed" + cutoff, 1.1)
    _legend(axes) if any_ else s.blank(axes, "no acceleration")


def _legend(axes: Axes) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4, columnspacing=1.0, borderpad=0)


def _same(rows: pd.DataFrame, one: str, other: str) -> bool:
    return bool(np.allclose(_v(rows, one), _v(rows, other), atol=1e-9, equal_nan=True))


def _t(rows: pd.DataFrame) -> s.Array:
    return _v(rows, "time")


def _v(rows: pd.DataFrame, column: str) -> s.Array:
    return rows[column].to_numpy(float)
