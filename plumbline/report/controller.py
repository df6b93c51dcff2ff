"""The controller's section: what the law is, where it ends, how the methods compare, and what was left out and why."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from plumbline.report.sheets import MOST, Cell, Sheet, Show, cell, joined, sheet, significant, text, whole
from plumbline.report.words import plural

KEY = ["subject", "task", "condition"]
COUNTS = "output error"  # the method whose numbers count
DELAYED = "output error with delay"
METHODS = {
    COUNTS: "output error: these count",
    DELAYED: "output error, delay free",
    "instruments": "instruments: the check",
    "saturation": "least squares: the counter-example",
}


class Section(NamedTuple):
    """sentences: on the number of clusters and on the switches.  law, bounds, methods: tables.  empty: why there is nothing, else ""."""

    sentences: list[str]
    law: Sheet
    bounds: Sheet
    methods: Sheet
    empty: str


def section(tables: Mapping[str, pd.DataFrame]) -> Section:
    """Everything the section shows.  tables: loci, trust, clusters, choice, controller of all parts."""
    controller = tables["controller"]
    why = "" if len(controller) else "No loci, so no controller: nobody was pushed or released, or no such trial could be used."
    sentences = [] if why else [numbers(tables["choice"], tables["clusters"]), switches(tables["trust"])]
    main = _main(controller)
    return Section(sentences, _law(main), _bounds(main, tables["clusters"]), _methods(controller), why)


# -- sentences --------------------------------------------------------------------------------------------------------


def numbers(choice: pd.DataFrame, clusters: pd.DataFrame) -> str:
    """How many clusters of omega the loci form, and how many loci belong to none."""
    if choice.empty:
        return "No locus tells its \u03c9 alone, so nothing could be clustered."
    said = []
    chosen = choice[choice["chosen"]]
    for number, mine in chosen.groupby("number", sort=True):
        names = [" ".join(w for w in row if w) for row in mine[KEY].itertuples(index=False, name=None)]
        listed = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
        said.append(f"{plural(int(str(number)), 'cluster')} in {listed}")
    few = int((choice.groupby(KEY, observed=True)["number"].max() == 1).sum())
    short = f" In {plural(few, 'group')} there were too few loci to try a second one." if few else ""
    rule = "A further cluster counts only where it predicts loci left out better by more than two standard errors."
    several = clusters.groupby(KEY, observed=True)["cluster"].transform("max") > 1
    lost = int((several & (clusters["cluster"] == 0)).sum())
    none = f" Without \u03c9 of their own, and so in no cluster and in no gains: {plural(lost, 'locus')}." if lost else ""
    return f"Clusters of \u03c9: {'; '.join(said)}. {rule}{short}{none}"


def switches(trust: pd.DataFrame) -> str:
    """How many switches there are, and how far the rule of the returning pass and a person's marks are from them."""
    if trust.empty:
        return "No regimes, so no switches: the gains cannot be told."
    found = trust[trust["found"].notna()]
    loci = len(trust[["trial", "locus"]].drop_duplicates())
    said = f"{plural(len(found), 'switch')} between a limit and the law in {plural(loci, 'locus')}"
    seen, marked = found[found["rls"].notna()], found[found["mark"].notna()]
    if len(seen):
        said += f"; the rule of the returning pass saw {len(seen)} of them, half of these within {_median(seen['rls'] - seen['found'])} ms"
    if len(marked):
        said += f"; a person marked {len(marked)}, half of these within {_median(marked['mark_distance'])} ms; a mark overrides"
    return said + ("." if len(marked) else "; no person marked any.")


def _median(distance: pd.Series) -> str:
    return f"{1e3 * float(np.median(np.abs(distance))):.0f}"


# -- tables -----------------------------------------------------------------------------------------------------------


def _main(controller: pd.DataFrame) -> pd.DataFrame:
    """Rows of the method that counts, with the words for their loci and the delay found beside them."""
    rows = controller[controller["method"] == COUNTS]
    beside = controller[controller["method"] == DELAYED]
    late = {tuple(r): row for r, (_, row) in zip(beside[[*KEY, "cluster"]].to_numpy(), beside.iterrows(), strict=True)}
    return _named(rows).assign(
        delayed=[delay(row, late.get(tuple(row[k] for k in (*KEY, "cluster")))) for _, row in rows.iterrows()],
        loop=[loop(row) for _, row in rows.iterrows()],
    )


def _named(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with words for their trials and loci, and each estimate with its interval as one text."""
    most = rows.groupby(KEY, observed=True)["cluster"].transform("max") if len(rows) else rows["cluster"]
    which = ["all" if not c else f"cluster {c} of {n}" for c, n in zip(rows["cluster"], most, strict=True)]
    trials = [" ".join(w for w in pair if w) for pair in zip(rows["task"], rows["condition"], strict=True)]
    digits = {"omega": (3, 1.0), "k1": (3, 1.0), "k2": (3, 1.0), "reference": (2, 1e3), "limit_left": (2, 1e3), "limit_right": (2, 1e3)}
    said = {f"{n}_said": [estimate(row, n, *how) for _, row in rows.iterrows()] for n, how in digits.items()}
    columns = {"trials": trials, "which": which, **said}
    return rows.assign(**{k: pd.Series(v, index=rows.index, dtype=object) for k, v in columns.items()})


def estimate(row: pd.Series, name: str, digits: int, factor: float = 1.0) -> str:
    """A number and, on a line below, its interval; a dash where there is none."""
    value, low, high = (factor * row[f"{name}{end}"] for end in ("", "_low", "_high"))
    if value != value:
        return "never reached" if name.startswith("limit") and row["k1"] == row["k1"] else "\u2013"
    shown = [f"{round(v, digits) + 0.0:.{digits}f}" for v in (value, low, high)]
    return f"{shown[0]}\n{shown[1]}\u00a0to\u00a0{shown[2]}" if low == low else f"{shown[0]}\nno interval"


def delay(plain: pd.Series, late: pd.Series | None) -> str:
    """What is known of a delay.  plain, late: rows by output error without and with one.

    A delay counts where its interval leaves out nought and the error falls so much that the plain row warns of it.
    """
    if late is None or late["delay"] != late["delay"]:
        return "not fitted"
    if late["warning"]:
        return f"not told: {late['warning']}"
    value, low, high = (1e3 * late[f"delay{end}"] for end in ("", "_low", "_high"))
    if low != low:
        return f"{value:.0f} ms, no interval"
    if low <= 0:
        return f"no delay found\nat most {high:.0f} ms"
    said = f"{value:.0f} ms\n{low:.0f} to {high:.0f} ms"
    if plain["warning"].startswith("a delay"):
        return said
    return (
        f"not shown: {said.replace(chr(10), ', ')}, but the error stays {1e3 * late['error']:.2f} mm ({1e3 * plain['error']:.2f} without)"
    )


def loop(row: pd.Series) -> str:
    """The closed loop inside the limits in words, from its poles -omega q1, -omega q2 (Murai 2013, eq. 7)."""
    first, second = complex(row["q1_real"], row["q1_imag"]), complex(row["q2_real"], row["q2_imag"])
    omega = row["omega"]
    if first != first or second != second:
        return "\u2013"
    if first.imag:
        if first.real <= 0:
            return "swings, and ever wider"
        return f"swings at\u00a0{omega * abs(first.imag) / (2 * np.pi):.2f}\u00a0Hz\ndamping {first.real / abs(first):.2f}"
    slow, fast = sorted((first.real, second.real))
    if slow <= 0:
        return "does not return"
    return f"does not swing\ntime constants {1 / (omega * fast):.2f} and {1 / (omega * slow):.2f} s"


def left_out(row: pd.Series, clusters: pd.DataFrame) -> Cell:
    """How many loci of a row were not used for the gains, and why.  clusters: the table."""
    mine = clusters[(clusters[KEY] == list(row[KEY])).all(axis=1)]
    mine = mine[mine["cluster"] == row["cluster"]] if row["cluster"] else mine
    used = mine["gains"].astype(bool)
    reasons = mine["note"].where(used | (mine["note"] != ""), "no reason given")
    lines = [f"{n}: {why}" for why, n in reasons[~used].value_counts().sort_index().items()]
    lines += [f"{n} used in part: {why}" for why, n in reasons[used & (reasons != "")].value_counts().sort_index().items()]
    return Cell(plural(int((~used).sum()), "locus") if (~used).any() else "none", tuple(lines))


WHO: dict[str, tuple[str, Show]] = {"subject": ("subject", text), "trials": ("trials", text), "which": ("loci", text)}


def _law(main: pd.DataFrame) -> Sheet:
    late = main["warning"].str.startswith("a delay")
    main = main.assign(warning=main["warning"].where(~late, main["warning"] + ": then the row with a free delay counts"))
    columns = WHO | {
        "omega_said": ("\u03c9 [rad/s]", text), "k1_said": ("k1", text), "k2_said": ("k2 [s]", text),
        "loop": ("inside the limits the CoM", text), "delayed": ("delay", text), "warning": ("warning", joined),
    }  # fmt: skip
    return sheet(main, columns, "controller", "")


def _bounds(main: pd.DataFrame, clusters: pd.DataFrame) -> Sheet:
    shown = main.head(MOST)
    main = main.assign(
        used=main["loci"].where(main["k1"].notna(), 0),
        out=pd.Series([left_out(row, clusters) for _, row in shown.iterrows()], index=shown.index, dtype=object),
        noise=1e3 * main["feedback_sd"],
    )
    of_loci: dict[str, tuple[str, Show]] = {"used": ("loci used", whole), "out": ("loci left out of the gains", cell)}
    columns = WHO | {
        "reference_said": ("reference d [mm]", text), "limit_left_said": ("left limit [mm]", text),
        "limit_right_said": ("right limit [mm]", text), "noise": ("ZMP about the law, rms [mm]", significant),
    }  # fmt: skip
    return sheet(main, columns | of_loci, "controller", "")


def _methods(controller: pd.DataFrame) -> Sheet:
    order = {name: k for k, name in enumerate(METHODS)}
    rows = controller[controller["k1"].notna() & controller["method"].isin(list(METHODS))]
    rows = rows.assign(order=rows["method"].map(order)).sort_values([*KEY, "cluster", "order"], kind="stable")
    rows = _named(rows).assign(called=rows["method"].map(METHODS), off=1e3 * rows["error"])
    columns = WHO | {
        "called": ("method", text), "k1_said": ("k1", text), "k2_said": ("k2 [s]", text), "reference_said": ("reference d [mm]", text),
        "off": ("simulated CoM off by, rms in sample [mm]", significant),
    }  # fmt: skip
    made = sheet(rows, columns, "controller", "No gains by any method: the warnings above say why.")
    si = controller.iloc[:MOST]
    return replace(made, copy=str(si.to_csv(sep="\t", index=False, lineterminator="\n")) if len(si) else "")


def results(controller: pd.DataFrame, most: int = 3) -> list[str]:
    """Gains and limits of a few groups as text, for the methods paragraph; of more their range."""
    rows = controller[(controller["method"] == COUNTS) & controller["k1"].notna()]
    if len(rows) > most:
        spans = [f"{name} {rows[name].min():.3g} to {rows[name].max():.3g}{unit}" for name, unit in (("k1", ""), ("k2", " s"))]
        return [f"{', '.join(spans)} over {len(rows)} groups of loci"]
    return [_result(row) for _, row in rows.iterrows()]


def _result(row: pd.Series) -> str:
    name = " ".join(w for w in row[KEY] if w) + (f", cluster {row['cluster']}" if row["cluster"] else "")
    k1, k2 = (estimate(row, k, 3).replace("\n", " (").replace("\u00a0", " ") + ")" for k in ("k1", "k2"))
    limits: list[Any] = [f"{1e3 * row[k]:.1f} mm" for k in ("limit_left", "limit_right") if row[k] == row[k]]
    return f"{name}: k1 {k1}, k2 {k2} s, {'limits ' + ' and '.join(limits) if limits else 'no limit reached'}"
