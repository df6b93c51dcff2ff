"""Held-out error of each model with its 95 % interval, what sensor noise alone would give, and whether a rung earns its place."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.lines import Line2D

from plumbline.figures import _style as s

MOST = 12  # small panels
ABREAST = 4  # of them in a row
ROW = 0.24  # [in] of a rung
NAME = 26  # letters of a rung's name
SHARE = 0.25  # [1] of the noise floor that a rung must bring
BASE = {"plant": "the paper's equation", "control": "the paper's law"}
BEHIND = {"facecolor": "white", "edgecolor": "none", "pad": 0.6}
LABELS = {"weak": "held-out error, as ZMP [mm]", "free_run": "free-run error of the CoM [mm]"}
CONTROL = "output error of the CoM [mm]"
GROUP = ["ledger", "axis", "task", "subject", "condition", "kind"]


@s.styled
def draw(ladder: pd.DataFrame) -> Figure:
    """Plant, lateral and forward, held-out error above and free run below; the controller's ladder; small panels of groups.

    ladder: the cohort's table.
    """
    judged = ladder[ladder["error_mm"].notna()]  # a base row without an error was not judged
    if judged.empty:
        return s.empty("The ladder", "no held-out error: no subject has two trials with a CoM and a ZMP")
    table = earned(judged)
    plant, control = (table[table["ledger"] == k] for k in ("plant", "control"))
    groups, more = grouped(plant)
    count, others = plant["model"].nunique(), control["model"].nunique()
    heights = [1.3 + 2 * (ROW * count + 0.3), 0.95 + ROW * others if others else 0.0, _height(groups, count)]
    figure = s.page(sum(heights))
    parts = figure.subfigures(int(sum(h > 0 for h in heights)), 1, squeeze=False, height_ratios=[h for h in heights if h])[:, 0]
    _plant(parts[0], plant)
    if others:
        _control(parts[1], control)
    if groups:
        _small(parts[-1], plant, groups)
    s.footnote(figure, f"{more} more groups are in results/ladder.parquet." if more else "")
    return figure


def earned(ladder: pd.DataFrame) -> pd.DataFrame:
    """The ladder with a column `earns`: "yes", "no" or, for the base and where no interval can be given, "".

    A rung earns its place where its error lies below the 95 % interval of the rung before it, on the same trials, and falls by at least a
    quarter of the noise floor, where that is known.
    """
    out = ladder.reset_index(drop=True)
    error, low, floor = (out[k].to_numpy(float) for k in ("error_mm", "ci_low_mm", "noise_floor_mm"))
    earns = [""] * len(out)
    for rungs in out.groupby(GROUP, sort=False, observed=True).indices.values():
        for before, after in pairwise(rungs):
            enough = error[before] - error[after] >= SHARE * np.nan_to_num(floor[after])
            if np.isfinite(low[before]):
                earns[after] = "yes" if enough and error[after] < low[before] else "no"
    return out.assign(earns=earns)


# -- groups -----------------------------------------------------------------------------------------------------------


def grouped(plant: pd.DataFrame) -> tuple[list[tuple[str, str]], int]:
    """Small panels to draw, as (column, value); value "*" stands for every subject in one panel; and how many groups are left out."""
    groups: list[tuple[str, str]] = []
    for column in ("task", "condition", "subject"):
        values = sorted(set(plant[column]) - {"all"})
        if column == "subject" and len(values) > MOST - len(groups) and len(groups) < MOST:
            groups.append((column, "*"))
        elif len(values) > 1:
            groups += [(column, v) for v in values]
    return groups[:MOST], len(groups[MOST:])


def _of(plant: pd.DataFrame, column: str, value: str) -> pd.DataFrame:
    """Rows of one group; everything for column "all"."""
    mine = plant
    for name in ("task", "subject", "condition"):
        wanted = value if name == column else "all"
        mine = mine[mine[name] != "all"] if wanted == "*" else mine[mine[name] == wanted]
    return mine


# -- panels -----------------------------------------------------------------------------------------------------------


def _abreast(groups: Sequence[Any]) -> int:
    """Small panels in a row: two where there are no more."""
    return 2 if len(groups) <= 2 else ABREAST


def _height(groups: Sequence[Any], count: int) -> float:
    lines = -(-len(groups) // _abreast(groups))
    return lines * (0.45 + ROW * count) + 0.45 if groups else 0.0


def _plant(figure: FigureBase, plant: pd.DataFrame) -> None:
    """The pooled rungs of both axes, weak above and free run below; an axis has rungs of its own."""
    pooled = _of(plant, "all", "all")
    panels = figure.subplots(2, 2)
    for j, axis in enumerate(s.LETTER):
        mine = pooled[pooled["axis"] == axis]
        for i, (kind, label) in enumerate(LABELS.items()):
            _panel(panels[i, j], mine[mine["kind"] == kind], _models(mine), axis, label)
    figure.legend(handles=_keys(pooled), loc="outside upper left", ncols=3, columnspacing=1.5)


def _control(figure: FigureBase, control: pd.DataFrame) -> None:
    """The controller's rungs, for each axis on which it was judged."""
    pooled = _of(control, "all", "all")
    axes_judged = [axis for axis in s.LETTER if (pooled["axis"] == axis).any()]
    panels = figure.subplots(1, 2)
    for panel, axis in zip(panels, axes_judged, strict=False):
        mine = pooled[pooled["axis"] == axis].drop_duplicates("model")
        _panel(panel, mine, _models(mine), f"controller, {axis}", CONTROL)
    for panel in panels[len(axes_judged) :]:
        panel.set_visible(False)


def _small(figure: FigureBase, plant: pd.DataFrame, groups: Sequence[tuple[str, str]]) -> None:
    """One panel per group: held-out error, lateral where that was judged."""
    axis = next(a for a in s.LETTER if (plant["axis"] == a).any())
    weak = plant[(plant["kind"] == "weak") & (plant["axis"] == axis)]
    names = _models(weak)
    panels = figure.subplots(-(-len(groups) // _abreast(groups)), _abreast(groups), sharex=True, sharey=True, squeeze=False)
    for axes, (column, value) in zip(panels.flat, groups, strict=False):
        mine = _of(weak, column, value)
        axes.set_title(s.plain(f"{mine['subject'].nunique()} subjects" if value == "*" else value), fontsize=7.5)
        _style(axes)
        if value != "*":
            _floor(axes, mine, names)
        for y, name in enumerate(names):
            _mark(axes, mine[mine["model"] == name], y, 4.0, spread=value == "*")
    for axes in list(panels.flat)[len(groups) :]:
        axes.set_visible(False)
    highest = np.nanmax(weak.loc[_drawn(weak, groups), ["error_mm", "ci_high_mm", "noise_floor_mm"]].to_numpy())
    panels[0, 0].set(xlim=(0, 1.08 * highest or 1.0), ylim=(len(names) - 0.4, -0.6))
    panels[0, 0].set_yticks(range(len(names)), _labels(weak, names))
    figure.supxlabel(f"{axis} {LABELS['weak']}", fontsize=8)


def _drawn(weak: pd.DataFrame, groups: Sequence[tuple[str, str]]) -> "pd.Index[int]":
    """Rows that the small panels show."""
    return weak.index[np.any([weak.index.isin(_of(weak, *g).index) for g in groups], axis=0)]


def _panel(axes: Axes, chosen: pd.DataFrame, names: Sequence[str], title: str, label: str) -> None:
    axes.set_title(title)
    if chosen.empty:
        _style(axes)
        s.blank(axes, f"nothing was judged {title}")
        return
    axes.set_xlabel(label)
    _style(axes)
    axes.set_yticks(range(len(names)), _labels(chosen, names))
    axes.set_ylim(len(names) - 0.4, -0.6)
    _floor(axes, chosen, names)
    highest = np.nanmax(chosen[["error_mm", "ci_high_mm", "noise_floor_mm"]].to_numpy())
    axes.set_xlim(0, 1.3 * highest or 1.0)
    for y, name in enumerate(names):
        mine = chosen[chosen["model"] == name]
        _mark(axes, mine, y, 5.5)
        for one in s.rows(mine):
            at = np.nanmax([one.error_mm, one.ci_high_mm]) + 0.03 * highest
            said = ", does not earn its place" if one.earns == "no" and one.kind != "free_run" else ""
            axes.text(at, y, f"{one.error_mm:#.3g}{said}", va="center", fontsize=6.5, bbox=BEHIND)


def _style(axes: Axes) -> None:
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="x", color="#ececec", lw=0.6)


def _floor(axes: Axes, chosen: pd.DataFrame, names: Sequence[str]) -> None:
    """The noise floor as a line through the rungs; a model with a noisy channel has a higher one."""
    place = {name: y for y, name in enumerate(names)}
    known = chosen[chosen["noise_floor_mm"].notna()]
    x = [v for v in known["noise_floor_mm"] for _ in (0, 1)]
    y = [place[m] + d for m in known["model"] for d in (-0.5, 0.5)]
    if x:
        axes.plot(x, y, color=s.MEASURED, lw=1.2)


def _mark(axes: Axes, mine: pd.DataFrame, y: float, size: float, *, spread: bool = False) -> None:
    """Interval and error; hollow where the rung does not earn its place."""
    if spread:
        mine = mine.sort_values("subject")
        place = y + 0.3 * np.sin(2.4 * np.arange(len(mine)))  # the same at each run
        axes.plot(mine["error_mm"], place, ".", color=s.RESIDUAL, ms=2.5)
        return
    for one in s.rows(mine):
        axes.plot([one.ci_low_mm, one.ci_high_mm], [y, y], color=s.RESIDUAL, lw=1.6 if size > 4 else 1.1)
        inside = "white" if one.earns == "no" else s.RESIDUAL
        axes.plot(one.error_mm, y, "o", color=s.RESIDUAL, mfc=inside, ms=size, mew=1.2)


# -- names ------------------------------------------------------------------------------------------------------------


def _models(table: pd.DataFrame) -> list[str]:
    """Names of the models in the order of the ladder, the base first."""
    names = list(dict.fromkeys(table["model"]))
    return sorted(names, key=lambda n: n != "base")


def _labels(table: pd.DataFrame, names: Sequence[str]) -> list[str]:
    """What stands beside each rung: its name, and its effects where the name does not say them."""
    effects = dict(zip(table["model"], table["effects"], strict=True))
    base = BASE[table["ledger"].iloc[0]]
    out = []
    for name in names:
        added = str(effects.get(name, ""))
        told = not added or name.startswith("+") or set(added.split(", ")) == {name}
        said = base if name == "base" else name if told else f"{name}: {added}"
        out.append(s.plain(said if len(said) <= NAME else f"{said[: NAME - 1].rstrip(' ,:')}\u2026"))
    return out


def _keys(pooled: pd.DataFrame) -> list[Line2D]:
    error, hollow = (Line2D([], [], color=s.RESIDUAL, lw=1.6, marker="o", ms=5, mfc=c) for c in (s.RESIDUAL, "white"))
    error.set_label("error with 95 % interval")
    hollow.set_label("rung that does not earn its place")
    floor = Line2D([], [], color=s.MEASURED, lw=1.2, label="noise floor")
    return [error, floor, *([hollow] if (pooled["earns"] == "no").any() else [])]
