"""Held-out error of each model with its 95 % interval, and what sensor noise alone would give."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from plumbline.figures import _style as s

MOST = 24  # rows with a name; more subjects than that share one row
ROW = 0.22  # [in]
KINDS = {"weak": "held-out error, as ZMP [mm]", "free_run": "free-run error of the CoM [mm]"}


@s.styled
def draw(ladder: pd.DataFrame) -> Figure:
    """Columns: lateral and forward; a row of panels for the weak error and one for the free run.  ladder: the cohort's table."""
    plant = ladder[(ladder["ledger"] == "plant") & ladder["error_mm"].notna()]  # a base row without an error was not judged
    if plant.empty:
        return s.empty("The ladder", "no held-out error: no subject has two trials with a CoM and a ZMP")
    rows = layout(plant)
    figure = s.page(1.6 + 2 * ROW * (len(rows) + 1))
    panels = figure.subplots(2, 2, sharey=True)
    for i, kind in enumerate(KINDS):
        for j, axis in enumerate(s.LETTER):
            chosen = plant[(plant["kind"] == kind) & (plant["axis"] == axis)]
            _panel(panels[i, j], chosen, rows, kind, axis)
    panels[0, 0].set_yticks(range(len(rows)), [_name(key, plant) for key in rows])
    panels[0, 0].set_ylim(len(rows) - 0.4, -0.6)
    figure.legend(handles=_keys(), loc="outside upper left", ncols=3, columnspacing=1.5)
    return figure


Key = tuple[str, str, str, str]  # task, subject, condition, model; subject "*" stands for every subject in one row


def layout(plant: pd.DataFrame) -> list[Key]:
    """Rows from top to bottom: pooled, tasks, conditions, subjects."""
    keys = plant[["task", "subject", "condition", "model"]].drop_duplicates().itertuples(index=False, name=None)
    groups: dict[int, list[Key]] = {0: [], 1: [], 2: [], 3: []}
    for key in keys:
        groups[1 if key[0] != "all" else 2 if key[2] != "all" else 3 if key[1] != "all" else 0].append(key)
    if len(groups[1]) == len({k[3] for k in groups[1]}):
        groups[1] = []  # one task only: the same as the pooled row
    if len({k[1] for k in groups[3]}) == 1:
        groups[3] = []
    if len(groups[3]) > MOST:
        groups[3] = [("all", "*", "all", model) for model in sorted({k[3] for k in groups[3]})]
    return [key for number in sorted(groups) for key in groups[number]]


def _name(key: Key, plant: pd.DataFrame) -> str:
    task, subject, condition, model = key
    if subject == "*":
        name = f"{plant.loc[plant['subject'] != 'all', 'subject'].nunique()} subjects"
    else:
        name = next((v for v in (task, subject, condition) if v != "all"), "all trials")
    return s.plain(name if model == "base" else f"{name}, {model}")


def _panel(axes: Axes, chosen: pd.DataFrame, rows: list[Key], kind: str, axis: str) -> None:
    axes.set_title(axis)
    axes.set_xlabel(KINDS[kind])
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    if chosen.empty:
        s.blank(axes, f"nothing was judged {axis}")
        axes.set_xlabel("")
        return
    axes.grid(axis="x", color="#ececec", lw=0.6)
    for y, key in enumerate(rows):
        _row(axes, chosen, key, y)
    highest = np.nanmax(chosen[["error_mm", "ci_high_mm", "noise_floor_mm"]].to_numpy())
    axes.set_xlim(0, 1.08 * highest or 1.0)


def _row(axes: Axes, chosen: pd.DataFrame, key: Key, y: int) -> None:
    task, subject, condition, model = key
    mine = chosen[chosen["model"] == model]
    if subject == "*":
        mine = mine[mine["subject"] != "all"].sort_values("subject")
        place = y + 0.35 * np.sin(2.4 * np.arange(len(mine)))  # spread over the row, the same at each run
        axes.plot(mine["error_mm"], place, ".", color=s.RESIDUAL, ms=2.5)
        return
    mine = mine[(mine["task"] == task) & (mine["subject"] == subject) & (mine["condition"] == condition)]
    for one in s.rows(mine):
        axes.plot([one.ci_low_mm, one.ci_high_mm], [y, y], color=s.RESIDUAL, lw=1.6)
        axes.plot(one.error_mm, y, "o", color=s.RESIDUAL, ms=5)
        axes.plot([one.noise_floor_mm] * 2, [y - 0.35, y + 0.35], color=s.MEASURED, lw=1.2)


def _keys() -> list[Line2D]:
    return [
        Line2D([], [], color=s.RESIDUAL, lw=1.6, marker="o", ms=5, label="error with 95 % interval"),
        Line2D([], [], color=s.MEASURED, lw=0, marker="|", ms=8, mew=1.2, label="noise floor"),
    ]
