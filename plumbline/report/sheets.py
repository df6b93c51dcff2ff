"""The tables of the page: chosen columns, units in the heads, rows capped with a word on where the rest is."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import pandas as pd

from plumbline.figures.ladder import earned
from plumbline.report.words import number, plural

MOST = 200  # rows shown of a table

FILES = (
    ("trials", "trials/", "what was read of each file, what was found in it, and why a file was not used"),
    ("markers, plates", "markers/ plates/", "the recordings in SI and common axes"),
    ("signals", "signals/", "CoM, ZMP, forces, angular momentum, support limits, frame by frame"),
    ("coverage", "coverage/", "which CoM, how much of the body, what cannot be judged"),
    ("sesc, chain", "sesc/ chain/", "the subject's own CoM frame by frame, with its predicted error; what was learnt of each segment"),
    ("poses, guidance", "poses/ guidance/", "still windows and why others were not used; what is observable, what to record next"),
    ("centres", "centres/", "CoM methods side by side: Newton in motion, the gravity line at rest"),
    ("stability, margins", "stability/ margins/", "extrapolated CoM and margin of stability frame by frame; by trial"),
    ("pushes, loci", "pushes/ loci/", "windows of unmeasured force; stretches of balancing alone"),
    ("trust, rls", "trust/ rls/", "regimes of each locus and the switches between them; recursive least squares frame by frame"),
    ("clusters, choice", "clusters/ choice/", "\u03c9 of each locus, its cluster, why it was left out; scores by number of clusters"),
    ("controller", "controller/", "gains, limits, delay, poles by group, cluster and method, with intervals and warnings"),
    ("fit", "fit/", "natural frequency per locus, condition and subject, with interval and warnings"),
    ("heldout", "heldout/", "errors of each trial with the model found without it"),
    ("residuals", "residuals/", "measured, modelled and what is left, frame by frame"),
    ("where", "where/", "the error in bins of phase plane, time, trial and frequency"),
    (
        "judged, candidates",
        "judged.parquet candidates.parquet",
        "what is missing, what became of every effect; by subject in judged/ candidates/",
    ),
    ("control", "control/", "errors of the simulated controller on loci left out, with each candidate"),
    ("rungs, contributions", "rungs/ contributions/", "errors of each model, trial by trial; what each effect adds, window by window"),
    ("ladder", "ladder.parquet", "held-out error of each model, pooled and by group"),
    ("exclusions", "exclusions.parquet", "files that could not be used"),
    ("verdict", "verdict.json", "the result for other programs"),
)

STATUS = {
    "found": "missing",
    "alike": "cannot be told from another",
    "refused": "refused",
    "settled": "fitted always, not needed enough for a name",
    "idle": "brings nothing",
    "absorbed": "leaves no trace here",
    "lacking": "cannot be judged",
}
"""What became of a candidate, in the order shown."""


@dataclass(frozen=True)
class Sheet:
    """A table ready to show: heads with units, rows of text, which columns are numbers or long texts, notes below, and a text to copy."""

    heads: Sequence[str]
    rows: Sequence[Sequence[Any]]
    numeric: frozenset[int]
    long: frozenset[int] = frozenset()
    note: str = ""
    empty: str = ""
    copy: str = ""


@dataclass(frozen=True)
class Cell:
    """A short text with more behind it."""

    text: str
    more: tuple[str, ...] = field(default=())


Show = Callable[[Any], Any]


def all_sheets(tables: Mapping[str, pd.DataFrame]) -> dict[str, Sheet]:
    """Every table of the page by name."""
    return {
        "trials": trials(tables["trials"], tables["coverage"]),
        "exclusions": exclusions(tables["exclusions"]),
        "pushes": counted(tables["pushes"], "pushes", ["task", "source"], "No push was marked or found."),
        "loci": counted(tables["loci"], "loci", ["task", "kind", "side", "source"], "No loci: nobody was pushed or released."),
        "fit": fit(tables["fit"]),
        "ladder": ladder(tables["ladder"]),
    }


def sheet(table: pd.DataFrame, columns: Mapping[str, tuple[str, Show]], where: str, empty: str) -> Sheet:
    """Show some columns of a table.  columns: name -> (head, how a value is shown)."""
    shown = table.iloc[:MOST]
    rows = [[show(value) for value, (_, show) in zip(row, columns.values(), strict=True)] for row in shown[list(columns)].to_numpy()]
    note = "" if len(table) <= MOST else f"The first {MOST} of {plural(len(table), 'row')}; all are in results/{where}."
    shows = [show for _, show in columns.values()]
    numeric = frozenset(i for i, show in enumerate(shows) if show not in WORDS)
    long = frozenset(i for i, show in enumerate(shows) if show is joined)
    return Sheet([head for head, _ in columns.values()], rows, numeric, long, note, "" if len(table) else empty)


# -- how values are shown ---------------------------------------------------------------------------------------------


def text(value: Any) -> str:
    """Text as it is; a dash where there is none."""
    return str(value) if value is not None and value == value and value != "" else "\u2013"


def whole(value: float) -> str:
    """An integer."""
    return f"{value:.0f}" if value == value else "\u2013"


def decimals(digits: int, factor: float = 1.0) -> Show:
    """A fixed number of decimals, in another unit."""
    # adding 0 turns a rounded -0 into 0
    return lambda v: f"{round(factor * v, digits) + 0.0:.{digits}f}" if v == v else "\u2013"


def significant(value: float) -> str:
    """Three digits that count."""
    return number(value) or "\u2013"


def sign(value: float) -> str:
    """+1 or -1 in words."""
    return {1.0: "reaction", -1.0: "turned"}.get(value, "\u2013")


def noted(value: str) -> Cell:
    """A JSON list of notes, folded away."""
    notes = tuple(str(n) for n in json.loads(value or "[]"))
    return Cell(plural(len(notes), "note") if notes else "\u2013", notes)


def cell(value: Cell) -> Cell:
    """What is a cell already."""
    return value


def joined(value: str) -> str:
    """Text that may be long."""
    return text(value)


def kind(value: str) -> str:
    """What an error of the ladder is an error of."""
    return {"weak": "ZMP", "free_run": "CoM, free run"}.get(value, value)


def spaced(value: str) -> str:
    """A code word as words."""
    return text(value).replace("_", " ")


def status(value: str) -> str:
    """What became of a candidate."""
    return STATUS.get(value, value)


WORDS = (text, noted, cell, joined, kind, spaced, sign, status)


# -- the tables -------------------------------------------------------------------------------------------------------


def trials(trials: pd.DataFrame, coverage: pd.DataFrame) -> Sheet:
    """What was read, one row per trial that could be used."""
    used = trials[trials["reason"] == ""]
    keep = ["trial", "mass", "com_method", "marker_set", "mass_share", "lab_distance", "support", "limitation"]
    used = used.drop(columns="mass").merge(coverage[keep], on="trial", how="left")
    share = used["filled"] / (used["markers"] * used["frames"]).where(lambda n: n > 0)
    columns: dict[str, tuple[str, Show]] = {
        "trial": ("trial", text), "rate": ("rate [Hz]", decimals(0)), "force_rate": ("plates at [Hz]", decimals(0)),
        "duration": ("length [s]", decimals(1)), "plates": ("plates", whole), "markers": ("markers", whole),
        "gaps": ("filled [%]", decimals(2, 100.0)), "mass": ("mass used [kg]", decimals(1)), "com_method": ("CoM", text),
        "marker_set": ("marker set", text), "mass_share": ("of body mass [%]", decimals(0, 100.0)),
        "lab_distance": ("from the lab's CoM [mm]", decimals(1, 1000.0)), "support": ("support from", text),
        "found": ("axes in the file", cell), "force_sign": ("vertical force", sign), "shear_sign": ("shear", sign),
        "limitation": ("what cannot be judged", joined), "notes": ("notes", noted),
    }  # fmt: skip
    found = [Cell(text(a), (f"from {b}",) if b else ()) for a, b in zip(used["axes"], used["axes_from"], strict=True)]
    return sheet(
        used.assign(gaps=share, found=pd.Series(found, index=used.index, dtype=object)),
        columns,
        "trials and results/coverage",
        "No trial could be used.",
    )


def exclusions(table: pd.DataFrame) -> Sheet:
    """Every file that could not be used."""
    columns = {"file": ("file", text), "reason": ("reason", text), "message": ("what was wrong", joined), "hint": ("what to do", joined)}
    return sheet(table, columns, "exclusions.parquet", "Every file was used.")


def counted(table: pd.DataFrame, name: str, by: Sequence[str], empty: str) -> Sheet:
    """How many rows of each kind."""
    counts = table.groupby(list(by), as_index=False, observed=True).size() if len(table) else table.assign(size=[])
    columns: dict[str, tuple[str, Show]] = {k: (k, spaced) for k in by}
    return sheet(counts, {**columns, "size": (name, whole)}, name, empty)


def fit(table: pd.DataFrame) -> Sheet:
    """Natural frequencies pooled per subject and condition; those of single loci stay in the file."""
    pooled = table[table["level"] != "locus"]
    groups = pooled.groupby(["subject", "axis", "level"], observed=True)["omega"].transform("size")
    pooled = pooled[(pooled["level"] == "subject") | (groups > 1)]  # one condition alone is the subject's row again
    pooled = pooled.assign(
        order=pooled["level"].map({"subject": 0, "condition": 1}),
        what=[t if not c else f"{t} {c}" for t, c in zip(pooled["task"], pooled["condition"], strict=True)],
    ).sort_values(["subject", "axis", "order", "what"], ascending=[True, False, True, True], kind="stable")
    pooled = pooled.assign(what=pooled["what"].where(pooled["level"] == "condition", "all trials"))
    columns: dict[str, tuple[str, Show]] = {
        "subject": ("subject", text), "axis": ("axis", text), "what": ("trials", text), "omega": ("\u03c9 [rad/s]", decimals(3)),
        "omega_low": ("95 % from", decimals(3)), "omega_high": ("to", decimals(3)), "omega_height": ("\u221a(g/z) [rad/s]", decimals(3)),
        "offset": ("offset [mm]", decimals(1, 1000.0)), "rms": ("rms in sample [mm]", decimals(2, 1000.0)), "windows": ("windows", whole),
        "rejected": ("rejected", whole), "clusters": ("pieces", whole), "warning": ("warning", joined),
    }  # fmt: skip
    made = sheet(pooled, columns, "fit", "No natural frequency: no trial has both a CoM and a ZMP.")
    loci = int((table["level"] == "locus").sum())
    more = f" The {plural(loci, 'estimate')} of single loci (both axes) are in results/fit and in the figure." if loci else ""
    return replace(made, note=(made.note + more).strip(), copy=_tabbed(pooled, list(columns)))


def _tabbed(table: pd.DataFrame, columns: list[str]) -> str:
    """A table as tab-separated text in SI units, for a spreadsheet or R; as many rows as are shown."""
    return str(table[columns].iloc[:MOST].to_csv(sep="\t", index=False, lineterminator="\n")) if len(table) else ""


def ladder(table: pd.DataFrame) -> Sheet:
    """Held-out errors; rows of single subjects come last."""
    columns: dict[str, tuple[str, Show]] = {
        "ledger": ("ledger", text), "axis": ("axis", text), "task": ("task", text), "condition": ("condition", text),
        "subject": ("subject", text), "kind": ("error of", kind),
        "model": ("model", text), "effects": ("effects added", text), "error_mm": ("error [mm]", significant),
        "ci_low_mm": ("95 % from", significant), "ci_high_mm": ("to", significant), "noise_floor_mm": ("noise floor [mm]", significant),
        "earns": ("earns its place", text),
    }  # fmt: skip
    ordered = earned(table).sort_values("subject", key=lambda v: v != "all", kind="stable")
    return sheet(ordered, columns, "ladder.parquet", "No held-out error: no subject has two trials with a CoM and a ZMP.")
