"""Where a law holds along a locus: measured ZMP against the identified law, regimes and switches, and RLS forward and returning."""

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from plumbline.figures import _style as s
from plumbline.models.controller import Law

MOST = 3  # subjects on a page
AFTER = 1.2  # [s] after the last switch that are drawn, at least
SHORTEST = 2.0  # [s] of a locus that are drawn at least, where it has them
HALF = 0.1  # [s] on both sides over which a parabola gives the CoM and its velocity to the law

FORWARD, BACKWARD = (":", 1.1), ("-", 1.3)  # style and width of the two passes, in every figure
BAND = "#cfe1f0"  # two standard deviations of the backward pass
LOCUS = ["trial", "locus"]
BAND_POINTS = 150  # instants at which the band is drawn
AT_LIMIT = "#ededed"
SCALES = {"k1": ("$k_1$ [1]", 1.2), "omega": (r"$\omega$ [rad/s]", 0.5)}  # half of each axis, as a share of the identified value


class Example(NamedTuple):
    """A locus that is drawn."""

    trial: str
    locus: int
    kind: str


@s.styled
def draw(
    trust: pd.DataFrame, rls: pd.DataFrame, signals: pd.DataFrame, loci: pd.DataFrame, clusters: pd.DataFrame, controller: pd.DataFrame
) -> Figure:
    """A column of panels per locus: positions, then k1 and omega by recursive least squares; the loci of :func:`choose`.

    trust, rls, signals, loci, clusters, controller: tables of a part.
    """
    if trust.empty:
        return s.empty("Regimes of the controller", _reason(signals, loci))
    subjects = sorted(trust["subject"].unique())
    blocks = [examples for subject in subjects[:MOST] if (examples := choose(trust[trust["subject"] == subject], loci))]
    figure = s.page(0.7 + 4.0 * len(blocks))
    grid = figure.add_gridspec(len(blocks), max(map(len, blocks)))
    clustered = loci.merge(clusters[[*LOCUS, "cluster"]], on=LOCUS, how="left")
    for row, examples in enumerate(blocks):
        for column, example in enumerate(examples):
            panels = np.asarray(grid[row, column].subgridspec(3, 1, height_ratios=[1.7, 1, 1]).subplots(sharex=True))
            parts, passes, locus = (_of(table, example) for table in (trust, rls, clustered))
            frames = signals[signals["trial"] == example.trial]
            _column(panels, example, parts.sort_values("part"), passes.sort_values("time"), frames, locus.iloc[0], controller)
            figure.align_ylabels(list(panels))
    figure.legend(handles=_keys(trust), loc="outside upper left", ncols=4, columnspacing=1.5)
    s.footnote(figure, _note(trust, blocks, subjects[MOST:]))
    return figure


def choose(trust: pd.DataFrame, loci: pd.DataFrame) -> list[Example]:
    """At most one locus of one subject that recovers and one that falls.

    trust: rows of the subject.  Of each kind loci with a person's mark come first, then those with a switch, then the others; of
    these it is the one with the median time at a limit: neither the clearest nor the most doubtful.
    """
    at_limit = (trust["end"] - trust["start"]).where(trust["regime"] != "inside", 0.0)
    about = trust.assign(held=at_limit).groupby(LOCUS, observed=True, as_index=False)
    ordered = about.agg(held=("held", "sum"), parts=("part", "max"), marked=("mark", "count"))
    ordered = ordered.merge(loci[[*LOCUS, "kind"]], on=LOCUS)
    falls = ordered["kind"] == "falling"
    out = []
    for mine in (ordered[~falls], ordered[falls]):
        for good in (mine["marked"] > 0, mine["parts"] > 1, mine["parts"] > 0):
            if good.any():
                chosen = mine[good].sort_values(["held", "trial", "locus"], kind="stable")
                row = chosen.iloc[(len(chosen) - 1) // 2]
                out.append(Example(str(row["trial"]), int(row["locus"]), str(row["kind"])))
                break
    return out


def law(x: s.Array, v: s.Array, row: pd.Series) -> s.Array:
    """ZMP of the identified law [m], d + k1 (x - d) + k2 x' within the limits that were ever reached.

    x [m], v [m/s]: shape (n,).  row: of `controller`.
    """
    left, right = (row[f"limit_{side}"] for side in ("left", "right"))
    known = {k: float(v) for k, v in (("left", left), ("right", right)) if np.isfinite(v)}
    return Law(row["reference"], row["k1"], row["k2"], **known).zmp(x, v)


def motion(x: s.Array, time: s.Array) -> tuple[s.Array, s.Array]:
    """Position [m] and velocity [m/s] from the parabola over HALF on both sides of each frame; near the ends from the last whole one.

    x [m], time [s], evenly spaced: shape (n,), NaN where the parabola meets a gap or there are too few frames for one.
    """
    k = max(1, round(HALF / float(np.median(np.diff(time))))) if len(time) > 1 else 1
    if len(x) < 2 * k + 1:
        return np.full(len(x), np.nan), np.full(len(x), np.nan)
    step = np.arange(-k, k + 1) * float(np.median(np.diff(time)))
    inverse = np.linalg.pinv(np.vander(step, 3, increasing=True))
    at, slope, bend = (np.lib.stride_tricks.sliding_window_view(x, 2 * k + 1) @ inverse.T).T
    ends = ((at[0], slope[0], bend[0], step[:k]), (at[-1], slope[-1], bend[-1], step[k + 1 :]))
    first, last = ((a + b * t + c * t**2, b + 2 * c * t) for a, b, c, t in ends)
    return np.concatenate([first[0], at, last[0]]), np.concatenate([first[1], slope, last[1]])


def identified(controller: pd.DataFrame, locus: pd.Series) -> tuple[pd.Series | None, float]:
    """Row of the law, by output error, of the locus' cluster, else of the one of its group with the most loci; None where none has gains.

    Beside it omega of the locus' cluster [rad/s].  locus: row of `loci` with its `cluster`.
    """
    mine = controller[controller["method"] == "output error"]
    for key in ("subject", "task", "condition"):
        mine = mine[mine[key] == locus[key]]
    ordered = mine.assign(other=mine["cluster"] != locus["cluster"]).sort_values(["other", "loci"], ascending=[True, False], kind="stable")
    known = ordered[ordered["k1"].notna()]
    return known.iloc[0] if len(known) else None, float(ordered["omega"].iloc[0]) if len(ordered) else float("nan")


# -- one locus --------------------------------------------------------------------------------------------------------


def _column(
    panels: s.Panels, example: Example, parts: pd.DataFrame, passes: pd.DataFrame, frames: pd.DataFrame, locus: pd.Series,
    controller: pd.DataFrame,
) -> None:  # fmt: skip
    """Panels of one locus.  parts, passes: its rows of `trust` and `rls`, in order.  frames: rows of `signals` of its trial."""
    begin, last = float(parts["start"].min()), float(parts["end"].max())
    end = min(last, max(float(parts["start"].max()) + AFTER, begin + SHORTEST))  # a good while after the last switch
    row, omega = identified(controller, locus)
    _positions(panels[0], frames[frames["time"].between(begin - 1e-9, min(last, end + HALF) + 1e-9)], row)
    passes = passes[passes["time"] <= end + 1e-9]
    for axes, name, value in zip(panels[1:], SCALES, (float("nan") if row is None else float(row["k1"]), omega), strict=True):
        _passes(axes, passes, name, value)
    for axes in panels:
        _regimes(axes, parts, end)
    panels[0].set_xlim(begin, end)
    panels[0].set_title(s.plain(_title(example, locus, parts)), fontsize=7.5)
    panels[-1].set_xlabel("time $t$ [s]")


def _of(table: pd.DataFrame, example: Example) -> pd.DataFrame:
    return table[(table["trial"] == example.trial) & (table["locus"] == example.locus)]


def _title(example: Example, locus: pd.Series, parts: pd.DataFrame) -> str:
    """Which locus, and how far the rule and the person are from the first switch."""
    said = f"{example.trial}, locus {example.locus}\n{example.kind.replace('_', ' ')}, {locus['side']}"
    switches = parts[parts["part"] > 1]
    if switches.empty:
        return f"{said}\nno switch"
    first = switches.iloc[0]
    said += f"\nswitch at {first['found']:.3f} s" if len(switches) == 1 else f"\n{len(switches)} switches, first at {first['found']:.3f} s"
    if np.isfinite(first["rls"]):
        said += f", RLS {1e3 * (first['rls'] - first['found']):+.0f} ms"
    if np.isfinite(first["mark"]):
        said += f", person {1e3 * (first['mark'] - first['found']):+.0f} ms"
    return said


def _positions(axes: Axes, frames: pd.DataFrame, row: pd.Series | None) -> None:
    time, x, p = (frames[c].to_numpy(float) for c in ("time", "com_x", "zmp_x"))
    s.line(axes, time, 1e3 * p, s.MEASURED, width=1.5)
    s.line(axes, time, 1e3 * x, s.MEASURED_TOO, width=1.2)
    axes.set_ylabel("position $x$ [mm]")
    if row is None:
        axes.text(0.98, 0.04, "no gains, so no law", transform=axes.transAxes, ha="right", color="#555555", fontsize=7)
        return
    s.line(axes, time, 1e3 * law(*motion(x, time), row), s.MODEL, width=0.9)
    for limit in (row["limit_left"], row["limit_right"]):
        # a limit far from everything measured would only press the lines together
        if np.nanmin(p) - 0.05 < limit < np.nanmax(p) + 0.05:
            axes.axhline(1e3 * limit, color=s.MODEL, lw=0.6, ls=(0, (6, 2)), zorder=0.5)


def _passes(axes: Axes, passes: pd.DataFrame, name: str, value: float) -> None:
    """Both passes; what is far from the identified value runs off the axis, and is still in the line."""
    label, share = SCALES[name]
    time, forward, backward, sd = (passes[c].to_numpy(float) for c in ("time", f"{name}_forward", f"{name}_backward", f"{name}_sd"))
    axes.set_ylabel(label)
    if not np.isfinite(value):
        known = np.concatenate([forward, backward])
        value = float(np.median(known[np.isfinite(known)])) if np.isfinite(known).any() else 1.0
    else:
        axes.axhline(value, color=s.MODEL, lw=0.6, ls=(0, (6, 2)), zorder=0.5)
    low, high = value - share * abs(value), value + share * abs(value)
    far = high - low
    with np.errstate(invalid="ignore"):
        borders = [np.clip(backward + side * sd, low - far, high + far) for side in (-2, 2)]
    every = -(-len(time) // BAND_POINTS)
    axes.fill_between(time[::every], *(b[::every] for b in borders), color=BAND, lw=0, zorder=0.3)
    for values, (style, width) in ((forward, FORWARD), (backward, BACKWARD)):
        s.line(axes, time, np.clip(values, low - far, high + far), s.MODEL, width=width, style=style)
    axes.set_ylim(low, high)


def _regimes(axes: Axes, parts: pd.DataFrame, end: float) -> None:
    """Shade where the ZMP is at a limit; lines where the law changes."""
    for part in s.rows(parts):
        if part.regime != "inside":
            axes.axvspan(part.start, min(part.end, end), color=AT_LIMIT, lw=0, zorder=0.1)
        for when, style in ((part.found, _FOUND), (part.rls, _RLS), (part.mark, _MARK)):
            if np.isfinite(when):
                axes.axvline(when, zorder=1, **style)


_FOUND: dict[str, Any] = {"color": s.MEASURED, "lw": 0.9, "ls": "-"}
_RLS: dict[str, Any] = {"color": s.MODEL, "lw": 1.1, "ls": "--"}
_MARK: dict[str, Any] = {"color": s.MEASURED, "lw": 1.1, "ls": ":"}


# -- words ------------------------------------------------------------------------------------------------------------


def _keys(trust: pd.DataFrame) -> list[Artist]:
    """What is drawn, but a mark only where there is one."""
    keys: list[Artist] = [
        Line2D([], [], color=s.MEASURED, lw=1.5, label="ZMP"),
        Line2D([], [], color=s.MEASURED_TOO, lw=1.2, label="CoM"),
        Line2D([], [], color=s.MODEL, lw=0.9, label="identified law"),
        Line2D([], [], color=s.MODEL, lw=0.6, ls=(0, (6, 2)), label=r"identified limit, $k_1$, $\omega$"),
        Line2D([], [], color=s.MODEL, lw=FORWARD[1], ls=FORWARD[0], label="forward pass"),
        Line2D([], [], color=s.MODEL, lw=BACKWARD[1], ls=BACKWARD[0], label="backward pass"),
        Patch(color=BAND, lw=0, label="its two standard deviations"),
        Patch(color=AT_LIMIT, lw=0, label="ZMP at a limit"),
        Line2D([], [], label="switch by change point", **_FOUND),
        Line2D([], [], label="switch by the returning pass", **_RLS),
    ]
    return keys + ([Line2D([], [], label="switch by a person", **_MARK)] if trust["mark"].notna().any() else [])


def _note(trust: pd.DataFrame, blocks: list[list[Example]], left_out: list[str]) -> str:
    drawn = sum(len(examples) for examples in blocks)
    total = trust[LOCUS].drop_duplicates().shape[0]
    said = f"{drawn} of {total} loci: per subject one that recovers and one that falls, marked ones first, then with a switch, "
    said += "of these the median by time at a limit."
    return f"{said} {s.not_drawn(left_out, 'results/trust')}".strip()


def _reason(signals: pd.DataFrame, loci: pd.DataFrame) -> str:
    if loci.empty:
        return f"no loci in the {signals['trial'].nunique()} trials of this part: no controller"
    return f"no gains can be told from the {len(loci)} loci of this part: results/clusters and results/controller say why"
