"""The page's part on the centre of mass: the subject's own against the table's, the methods side by side, what to record next."""

import json
from collections.abc import Mapping
from typing import Any

import pandas as pd

from plumbline.report.sheets import Cell, Sheet, Show, cell, counted, decimals, joined, sheet, text, whole
from plumbline.still import LOAD, PULL, SPEED
from plumbline.tables import empty


def all_sheets(tables: Mapping[str, pd.DataFrame]) -> dict[str, Sheet]:
    """Tables of the part by name; those of a study without markers say so."""
    guidance, centres, poses = (tables.get(n, empty(n)) for n in ("guidance", "centres", "poses"))
    return {
        "own": own(guidance),
        "centres": methods(centres),
        "poses": windows(poses),
        "margins": margins(tables.get("margins", empty("margins"))),
    }


def own(guidance: pd.DataFrame) -> Sheet:
    """How well each subject's own CoM is known, and which pose to record next."""
    shown = guidance.assign(
        table=_three(guidance, "table_sd"),
        own=_three(guidance, "sd"),
        vertical=[rests(bool(ok), int(n)) for ok, n in zip(guidance["vertical_observable"], guidance["learnt"], strict=True)],
        what=pd.Series([following(str(n)) for n in guidance["next"]], index=guidance.index, dtype=object),
    )
    columns: dict[str, tuple[str, Show]] = {
        "subject": ("subject", text), "windows": ("still windows", whole), "learnt": ("directions learnt", whole),
        "table": ("table: right / forward / up [mm]", text), "own": ("own: right / forward / up [mm]", text),
        "outside": ("outside of still poses [%]", decimals(0, 100.0)), "vertical": ("the vertical", joined), "what": ("record next", cell),
    }  # fmt: skip
    return sheet(shown, columns, "guidance", "No CoM from markers, so none of the subject's own.")


def _three(guidance: pd.DataFrame, name: str) -> list[str]:
    """Predicted errors of the three directions in one cell."""
    return [" / ".join(f"{1e3 * v:.1f}" for v in row) for row in guidance[[f"{name}_{a}" for a in "xyz"]].to_numpy(float)]


def rests(observable: bool, learnt: int) -> str:
    """What the vertical rests on, in words."""
    if not learnt:
        return "nothing was learnt: the table's"
    return "told by the recordings" if observable else "not observable: it rests on the table and the spread of people"


def following(steps: str) -> Cell:
    """The best next pose, and what it and those after it would bring."""
    found = json.loads(steps or "[]")
    if not found:
        return Cell("\u2013")
    lines = (f"{s['pose']}: then {' / '.join(f'{1e3 * v:.1f}' for v in s['sd'])} mm" for s in found)
    return Cell(str(found[0]["pose"]), tuple(lines))


def methods(centres: pd.DataFrame) -> Sheet:
    """CoM methods side by side."""
    columns: dict[str, tuple[str, Show]] = {
        "subject": ("subject", text), "method": ("CoM", text), "rank": ("rank in motion", rank), "windows": ("windows in motion", whole),
        **{f"r_force_{a}": (f"x'' - F/m, {w} [m/s\u00b2]", decimals(3)) for a, w in zip("xyz", ("right", "forward", "up"), strict=True)},
        "rank_still": ("rank at rest", rank), "poses": ("still windows", whole),
        "static_x": ("at rest, right [mm]", decimals(1, 1000.0)), "static_y": ("at rest, forward [mm]", decimals(1, 1000.0)),
        "note": ("note", joined),
    }  # fmt: skip
    return sheet(centres, columns, "centres", "No CoM beside forces.")


def rank(value: float) -> str:
    """A place; a dash where there is none."""
    return f"{value:.0f}" if value else "\u2013"


def gate(sesc: Mapping[str, Any]) -> str:
    """When a window is still, in words.  sesc: that section of the config."""
    return (
        f"A window of {sesc['window']:g} s is still where the motion moves the ZMP by less than {1e3 * sesc['limit']:g} mm (z x''/g), "
        f"the CoM stays below {SPEED:g} m/s, the plates carry body weight to {LOAD:.0%} and nothing pulls to the side by more than "
        f"{PULL:.0%} of it."
    )


def windows(poses: pd.DataFrame) -> Sheet:
    """Still windows by what became of them; sizes in the reasons are left to the table."""
    said = poses.assign(what=poses["reason"].str.replace(r"[\d.]+ ?%? ?", "", regex=True).where(~poses["used"], "used"))
    return counted(said, "windows", ["task", "what"], "No CoM from markers.")


def margins(margins: pd.DataFrame) -> Sheet:
    """How near to falling over the feet: by subject, task and CoM."""
    by = margins.groupby(["subject", "task", "condition", "method"], sort=True, observed=True)
    values = [f"{k}_{a}" for a in "xy" for k in ("least", "step", "outside")]
    shown = by[["omega", *values]].median().assign(trials=by.size()).reset_index()
    columns: dict[str, tuple[str, Show]] = {
        "subject": ("subject", text), "task": ("task", text), "condition": ("condition", text), "method": ("CoM", text),
        "trials": ("trials", whole), "omega": ("\u03c9 [rad/s]", decimals(2)),
    }  # fmt: skip
    for a, way in (("x", "right or left"), ("y", "front or back")):
        columns |= {
            f"least_{a}": (f"smallest margin, {way} [mm]", decimals(0, 1000.0)), f"step_{a}": (f"step, {way} [mm]", decimals(0, 1000.0)),
            f"outside_{a}": (f"outside, {way} [%]", decimals(0, 100.0)),
        }  # fmt: skip
    return sheet(shown, columns, "margins", "No CoM from markers or in the files.")
