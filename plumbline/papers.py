"""Reproduce numbers, not bytes: named tables against committed references, with a tolerance per column."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from plumbline.errors import PlumblineError


def compare_all(repo: Path) -> Iterator[tuple[str, bool]]:
    """Compare every study that has a reference; yields (line to print, fine).

    A reference is `studies/NAME/reference/reference.yaml`: which results, which tables, their keys, their columns with tolerances.
    """
    files = sorted((repo / "studies").glob("*/reference/reference.yaml"))
    if not files:
        yield "no study has a reference yet", True
    for file in files:
        about = yaml.safe_load(file.read_text(encoding="utf-8"))
        results = (file.parent / about["results"]).resolve()
        for name, table in about["tables"].items():
            for line, fine in compare(file.parent / f"{name}.csv", results / table["file"], table):
                yield f"{file.parent.parent.name}/{name}: {line}", fine


def compare(reference: Path, result: Path, about: dict[str, Any]) -> Iterator[tuple[str, bool]]:
    """One table: rows are matched by `keys`; a column drifts where abs(new - old) > abs + rel * abs(old).

    about: {keys: [...], columns: {name: {rel: , abs: }}}.  Yields one line per column and one for rows that only one side has.
    Raises PlumblineError where a file is absent.
    """
    for file in (reference, result):
        if not file.exists():
            raise PlumblineError(f"{file} is not there; run the study first")
    keys = about["keys"]
    old = pd.read_csv(reference, dtype=dict.fromkeys(keys, str), keep_default_na=False, na_values=["nan"])
    new = pd.read_parquet(result).astype(dict.fromkeys(keys, str))
    both = old.merge(new, on=keys, how="outer", suffixes=("_old", "_new"), indicator=True)
    lost, more = (int((both["_merge"] == side).sum()) for side in ("left_only", "right_only"))
    yield f"{len(both)} rows" + (f", {lost} missing, {more} new" if lost or more else ""), not (lost or more)
    both = both[both["_merge"] == "both"]
    for column, tolerance in about["columns"].items():
        a, b = both[f"{column}_old"].to_numpy(float), both[f"{column}_new"].to_numpy(float)
        drift = np.where(np.isnan(a) & np.isnan(b), 0.0, np.abs(b - a))
        allowed = tolerance.get("abs", 0.0) + tolerance.get("rel", 0.0) * np.abs(np.nan_to_num(a))
        bad = ~(drift <= allowed)
        worst = float(np.nanmax(drift)) if len(drift) and not np.isnan(drift).all() else float(len(drift) and np.nan)
        yield (
            f"{column}: largest drift {worst:.3g}" + (f", {bad.sum()} of {len(bad)} beyond tolerance" if bad.any() else ""),
            not bad.any(),
        )


def freeze_all(folder: Path) -> Iterator[str]:
    """Write every table of a reference anew from its results; yields lines to print.  folder: studies/NAME/reference."""
    file = folder / "reference.yaml"
    if not file.is_file():
        raise PlumblineError(f"{file} is not there: it says which tables and columns a reference holds")
    about = yaml.safe_load(file.read_text(encoding="utf-8"))
    for name, table in about["tables"].items():
        freeze(folder / f"{name}.csv", (folder / about["results"]).resolve() / table["file"], table)
        yield f"{folder / name}.csv"


def freeze(reference: Path, result: Path, about: dict[str, Any]) -> None:
    """Write a reference from a result: the named keys and columns, 12 digits."""
    table = pd.read_parquet(result)[[*about["keys"], *about["columns"]]]
    table.to_csv(reference, index=False, float_format="%.12g", na_rep="nan")
