"""Numbers and counts in words."""

from collections.abc import Mapping
from typing import Any

import pandas as pd


def number(value: float | None, digits: int = 3) -> str:
    """A number with so many digits that count; empty for None and NaN."""
    if value is None or value != value:
        return ""
    if abs(value) >= 10**digits:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def pooled(ladder: pd.DataFrame, axis: str, kind: str) -> dict[str, Any]:
    """The base rung over everything; empty where it is absent."""
    mine = ladder[(ladder["ledger"] == "plant") & (ladder["model"] == "base") & (ladder["axis"] == axis) & (ladder["kind"] == kind)]
    mine = mine[(mine["task"] == "all") & (mine["subject"] == "all") & (mine["condition"] == "all")]
    return {str(k): v for k, v in mine.iloc[0].items()} if len(mine) else {}


def sentence(error: float | None, floor: float | None, low: str, high: str) -> str:
    """How far the model is from the measurement."""
    if error is None:
        return "No error can be stated."
    said = f"On trials it had not seen, the model misses the measured ZMP by {number(error)} mm rms"
    said += f" (95 % interval {low} to {high} mm)." if low else " (fewer than three trials: no interval)."
    if not floor:
        return said + " What sensor noise alone would give is not known here."
    return said + f" Sensor noise alone would give {number(floor)} mm: {_ratio(error / floor)}."


def _ratio(ratio: float) -> str:
    if ratio <= 1.25:
        return "the error is within a quarter of that floor"
    return f"the error is {number(ratio, 2)} times that floor"


def counts(tables: Mapping[str, pd.DataFrame]) -> str:
    """One line on how much was read."""
    trials, excluded = tables["trials"], tables["exclusions"]
    used = trials[trials["reason"] == ""]
    said = f"{plural(len(used), 'trial')} of {plural(used['subject'].nunique(), 'subject')} read"
    said += f", {plural(len(excluded), 'file')} excluded"
    return said + f"; {plural(len(tables['pushes']), 'push')} and {plural(len(tables['loci']), 'locus')}."


def plural(count: int, what: str) -> str:
    """Count and noun."""
    many = {"locus": "loci", "push": "pushes", "switch": "switches"}.get(what, what + "s")
    return f"{count:,} {what if count == 1 else many}".replace(",", "\u202f")
