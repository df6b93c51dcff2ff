"""Rows of the tables `trials`, `markers` and `plates` from recordings; text columns are categories: no row holds its own string."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from plumbline import tables
from plumbline.errors import Refused
from plumbline.readers.raw import Array
from plumbline.study import Trial

if TYPE_CHECKING:
    from plumbline.recording import Recording


def key_row(trial: Trial, raw: Path | None) -> dict[str, Any]:
    """What is known of a trial without reading it; numbers as unknown."""
    blank = {c.name: {"str": "", "int": 0, "float": math.nan, "bool": False}[c.kind] for c in tables.TABLES["trials"]}
    names = (str(f.relative_to(raw)) if raw and f.is_relative_to(raw) else f.name for f in trial.files)
    same = {
        "trial": trial.trial,
        "subject": trial.subject,
        "session": trial.session,
        "task": trial.task,
        "condition": trial.condition,
        "run": trial.run,
    }
    return blank | same | {"files": " + ".join(names), "notes": "[]"}


def refused_row(trial: Trial, refusal: Refused, raw: Path | None) -> dict[str, Any]:
    """The row of `trials` of a trial that cannot be used."""
    return key_row(trial, raw) | {"reason": refusal.reason, "message": refusal.message, "hint": refusal.hint}


def table(name: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Rows as a table of :data:`plumbline.tables.TABLES`."""
    return pd.DataFrame(rows, columns=[c.name for c in tables.TABLES[name]]) if rows else tables.empty(name)


def joined(name: str, parts: list[pd.DataFrame]) -> pd.DataFrame:
    """One table of all trials; text columns share their categories, so that no row holds a string of its own."""
    parts = [p for p in parts if len(p)]
    if not parts:
        return tables.empty(name)
    text = [c.name for c in tables.TABLES[name] if c.kind == "str"]
    for column in text:
        every = list(dict.fromkeys(label for p in parts for label in p[column].cat.categories))
        for part in parts:
            part[column] = part[column].cat.set_categories(every)
    return pd.concat(parts, ignore_index=True)


def label_column(labels: list[str], lengths: list[int]) -> "pd.Categorical[str]":
    """Each label repeated, as categories."""
    known = pd.Index(dict.fromkeys(labels), dtype=str)
    codes = known.get_indexer(pd.Index(labels))
    return pd.Categorical.from_codes(np.repeat(codes, lengths), known)


def marker_rows(r: "Recording") -> pd.DataFrame:
    """Rows of `markers`: each marker and derived point over all frames."""
    n = r.time.size
    blocks = [*r.markers.items(), *((f"@{label}", values) for label, values in r.derived.items())]
    xyz = np.concatenate([np.empty((0, 3)), *(v for _, v in blocks)])
    filled = np.zeros(len(xyz), dtype=bool)
    filled[: n * len(r.markers)] = np.concatenate([np.empty(0, dtype=bool), *r.filled.values()])
    frame, one = np.tile(np.arange(n), len(blocks)), [n * len(blocks)]
    return pd.DataFrame(
        {
            "trial": label_column([r.trial.trial], one), "subject": label_column([r.trial.subject], one),
            "frame": frame, "time": r.time[frame], "marker": label_column([k for k, _ in blocks], [n] * len(blocks)),
            "x": xyz[:, 0], "y": xyz[:, 1], "z": xyz[:, 2], "filled": filled,
        }
    )  # fmt: skip


def _xyz(prefix: str, values: Array) -> dict[str, Array]:
    return {f"{prefix}_{a}": values[:, i] for i, a in enumerate("xyz")}


def plate_rows(r: "Recording") -> pd.DataFrame:
    """Rows of `plates`."""
    lengths = [p.time.size for p in r.plates]
    whole = [sum(lengths)]
    force, moment, cop = (np.concatenate([np.empty((0, 3)), *(getattr(p, what) for p in r.plates)]) for what in ("force", "moment", "cop"))
    return pd.DataFrame(
        {
            "trial": label_column([r.trial.trial], whole), "subject": label_column([r.trial.subject], whole),
            "plate": np.repeat([p.number for p in r.plates], lengths).astype(np.int64),
            "foot": label_column([p.foot for p in r.plates], lengths) if r.plates else label_column([""], [0]),
            "sample": np.concatenate([np.empty(0, dtype=np.int64), *(np.arange(k) for k in lengths)]),
            "time": np.concatenate([np.empty(0), *(p.time for p in r.plates)]),
            **_xyz("force", force), **_xyz("moment", moment), **_xyz("cop", cop),
            "free_moment": np.concatenate([np.empty(0), *(p.free_moment for p in r.plates)]),
        }
    )  # fmt: skip
