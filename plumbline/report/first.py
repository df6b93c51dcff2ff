"""What the first screen says: how far the model is from the measurement, and what is missing."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import pandas as pd

from plumbline.effects import Effect
from plumbline.report.missing import Ledger, ledger
from plumbline.report.words import number, pooled, sentence

AXES = {"lateral": "left and right", "forward": "back and forth"}


class Axis(NamedTuple):
    """What is said of one axis. error, free_run, final, model: [mm] as text, empty where not known.

    final: with all that is missing.  model: with the configured model.  plant: the verdict in words.
    """

    name: str
    gloss: str
    error: str
    free_run: str
    final: str
    model: str
    sentence: str
    reason: str
    plant: Ledger


class Control(NamedTuple):
    """What is said of the controller on one axis; errors as in :class:`Axis`."""

    name: str
    error: str
    floor: str
    final: str
    reason: str
    ledger: Ledger


def look(verdict: Mapping[str, Any], ladder: pd.DataFrame, effects: Mapping[str, Effect], auto: bool) -> list[Axis]:
    """One entry per axis.  effects: the catalogue.  auto: models climb by themselves."""
    return [_axis(name, verdict, ladder, effects, auto) for name in AXES]


def _axis(name: str, verdict: Mapping[str, Any], ladder: pd.DataFrame, effects: Mapping[str, Effect], auto: bool) -> Axis:
    plant = verdict["by_axis"][name]["plant"]
    weak, free = (pooled(ladder, name, kind) for kind in ("weak", "free_run"))
    error, floor = plant["base_error_mm"], plant["noise_floor_mm"]
    low, high = (number(weak.get(k)) for k in ("ci_low_mm", "ci_high_mm"))
    said = ledger(plant, effects, auto)
    return Axis(
        name, AXES[name], number(error), number(free.get("error_mm")),
        number(plant["final_error_mm"]) if said.items else "", "" if auto or not verdict["model"] else number(plant["model_error_mm"]),
        sentence(error, floor, low, high), plant["reason"], said,
    )  # fmt: skip


def control(verdict: Mapping[str, Any], effects: Mapping[str, Effect], auto: bool) -> list[Control]:
    """What is said of the controller: lateral always, forward where it was judged."""
    out = []
    for name in AXES:
        block = verdict["by_axis"][name]["control"]
        if name == "lateral" or block["missing"] is not None:
            said = ledger(block, effects, auto, "loci")
            final = number(block["final_error_mm"]) if said.items else ""
            out.append(Control(name, number(block["base_error_mm"]), number(block["noise_floor_mm"]), final, block["reason"], said))
    return out
