"""Numbers in text files: bytes to lines, lines to columns, units to SI, time to a rate."""

import io
import re
from pathlib import Path

import numpy as np
import pandas as pd

from plumbline.errors import Refused
from plumbline.readers.raw import Array

MISSING = [
    "NaN",
    "nan",
    "NAN",
    "Nan",
    "naN",
    "nAn",
    "NAn",
    "nAN",
    "-nan",
    "-nan(ind)",
    "1.#QNAN",
    "-1.#IND",
    "n/a",
    "N/A",
    "NA",
    "-",
    "null",
]
UNITS = {
    "length": {"m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "metres": 1.0, "mete": 1.0, "mm": 1e-3, "millimeter": 1e-3,
               "millimeters": 1e-3, "millimetre": 1e-3, "millimetres": 1e-3, "cm": 1e-2, "centimeter": 1e-2, "centimeters": 1e-2},
    "force": {"n": 1.0, "newton": 1.0, "newtons": 1.0, "kn": 1e3},
    "moment": {"nm": 1.0, "nmm": 1e-3, "ncm": 1e-2, "nmeter": 1.0, "knm": 1e3},
    "time": {"s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
}  # fmt: skip
NEWLINE = re.compile("\r\n|\r|\n")


def decode(path: Path) -> tuple[list[str], bool, list[str]]:
    """Lines of a text file, whether the last one has its line end, and notes on the encoding.

    UTF-8 (with or without mark), UTF-16 with mark, else Latin-1.
    Raises Refused(empty_file) for no bytes, Refused(unreadable) for bytes that are no text.
    """
    data = path.read_bytes()
    if not data.strip():
        raise Refused("empty_file", f"{path.name} holds no text", "record or export it again")
    notes: list[str] = []
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        text = data.decode("utf-16", errors="replace")
    elif b"\0" in data[:65536]:
        raise Refused("unreadable", f"{path.name} is a binary file, not text", "export it as text, or give it its true ending")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
            notes.append(f"{path.name} is not UTF-8; read as Latin-1")
    lines = NEWLINE.split(text)
    ended = lines[-1].strip() == ""
    while lines and not lines[-1].strip("\t ,;"):
        lines.pop()
    return lines, ended, notes


def separator(line: str) -> str | None:
    """Tab, semicolon or comma where the line has one (in this order), else None for blanks."""
    return next((s for s in "\t;," if s in line), None)


def fields(line: str, sep: str | None) -> list[str]:
    """The fields of one line without blanks and quotes around them; sep None means any run of blanks."""
    return [f.strip().strip('"') for f in (line.split(sep) if sep else line.split())]


def frame(lines: list[str], sep: str | None, ended: bool, name: str, stated: int | None = None) -> pd.DataFrame:
    """Rows of numbers as a table with columns 0, 1, ...; columns that are not numbers stay text.

    lines: the data lines.  sep: as from `separator`.  ended: the last line has its line end.  stated: rows the header states.
    Raises Refused(empty_file) without rows and Refused(truncated) where the last line is cut.
    """
    if not lines:
        raise Refused("empty_file", f"{name} has a header but no rows", "record or export it again")
    counts = [line.count(sep) + 1 if sep else len(line.split()) for line in lines]
    width = max(counts)
    _check_last_line(counts, ended, name, stated)
    # Excel in half of Europe writes 1,5 for 1.5 and separates by semicolons or tabs
    comma = sep != "," and re.search(r"\d,\d", lines[0]) is not None and "." not in lines[0]
    return pd.read_csv(
        io.StringIO("\n".join(lines)), sep=sep or r"\s+", header=None, names=list(range(width)), skipinitialspace=True,
        na_values=MISSING, decimal="," if comma else ".", skip_blank_lines=True, low_memory=False,
    )  # fmt: skip


def _check_last_line(counts: list[int], ended: bool, name: str, stated: int | None) -> None:
    """A file that was cut shows in its last line: without a line end, or with a part of a row.

    Writers may drop the blanks of missing markers at the end of a row, three at a time (TRC): a shorter row alone is no cut.
    """
    usual = counts[-2] if len(counts) > 1 else counts[-1]
    short = counts[-1] < usual
    cut = (not ended and (short or (stated is not None and len(counts) < stated))) or (short and (usual - counts[-1]) % 3 != 0)
    if cut:
        rows = f" of {stated}" if stated is not None else ""
        raise Refused(
            "truncated",
            f"{name} breaks off in row {len(counts)}{rows} of its data",
            "copy or export the file again, whole",
        )


def numeric(column: pd.Series, what: str) -> Array:
    """A column as numbers, missing as NaN.

    Raises Refused(unreadable) naming the first cell that is neither a number nor missing.
    """
    if column.dtype.kind in "fiub":
        return np.asarray(column, dtype=float)
    text = column.astype("string").str.strip()
    values = pd.to_numeric(text, errors="coerce")
    odd = np.asarray(values.isna() & ~(text.isna() | text.isin(["", *MISSING])), dtype=bool)
    if odd.any():
        row = int(np.argmax(odd))
        raise Refused(
            "unreadable",
            f"{what}, row {row + 1} of the data: '{column.iloc[row]}' is no number",
            "correct the cell or export again",
        )
    return np.asarray(values, dtype=float)


def matrix(table: pd.DataFrame, name: str) -> Array:
    """All columns as numbers, shape (rows, columns).  Raises as `numeric`."""
    if all(d.kind in "fiub" for d in table.dtypes):
        return table.to_numpy(dtype=float)
    return np.column_stack([numeric(table[c], f"{name}, column {int(c) + 1}") for c in table.columns])


def factor(unit: str, kind: str, what: str) -> float:
    """What one unit is in SI.  kind: length, force, moment or time.  Raises Refused(no_unit) naming `what`."""
    plain = re.sub(r"[\s.*·⋅-]", "", unit).lower()
    known = UNITS[kind]
    if plain in known:
        return known[plain]
    said = f"the unit '{unit}' of {what} is not known" if plain else f"{what} has no unit"
    raise Refused("no_unit", said, f"state the {kind} unit ({', '.join(list(known)[:6])})")


def missing_as_nan(points: Array) -> Array:
    """Markers stored as exactly 0, 0, 0 or with a part missing become NaN.  points: shape (n, m, 3); returns a copy."""
    gone = np.isnan(points).any(axis=2) | (points == 0.0).all(axis=2)
    return np.where(gone[..., None], np.nan, points)


def unique(labels: list[str], notes: list[str]) -> list[str]:
    """Labels with `.2`, `.3` added to repeats; a note says which."""
    seen: dict[str, int] = {}
    out = []
    for label in labels:
        seen[label] = seen.get(label, 0) + 1
        out.append(label if seen[label] == 1 else f"{label}.{seen[label]}")
    repeats = sorted(k for k, v in seen.items() if v > 1)
    if repeats:
        notes.append(f"labels repeat and got a number: {', '.join(repeats)}")
    return out


JITTER = 0.1  # [1] of a sample interval: time stamps nearer than this to a straight line are even


def rate_of(time: Array, name: str) -> float:
    """Sampling rate of a time column [Hz]: the mean rate where it is even, else the median rate; NaN for one sample.

    Raises Refused(bad_time) where the time is missing or does not increase.
    """
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise Refused(
            "bad_time",
            f"{name}: no time in row {bad[0] + 1} of the data",
            "repair the time column, or state `rate` instead of it",
        )
    steps = np.diff(time)
    back = np.flatnonzero(steps <= 0)
    if back.size:
        raise Refused(
            "bad_time",
            f"{name}: time does not increase after row {back[0] + 1} ({time[back[0]]:g} s)",
            "sort the rows or cut the file there",
        )
    if time.size < 2:
        return float("nan")
    mean = (time.size - 1) / (time[-1] - time[0])
    rate = mean if is_even(time) else 1.0 / np.median(steps)
    return float(f"{rate:.9g}")  # 1000, not 1000.0000000000001


def is_even(time: Array) -> bool:
    """Whether the time stamps lie on a straight line within :data:`JITTER` of an interval, rounding of the stamps allowed."""
    if time.size < 3:
        return True
    index = np.arange(time.size)
    slope, start = np.polyfit(index, time - time[0], 1)
    off = float(np.max(np.abs(time - time[0] - start - slope * index)))
    return bool(off <= JITTER * slope + 0.51 * _resolution(time))


def _resolution(time: Array) -> float:
    """Last decimal that the time stamps carry [s], e.g. 0.001 for stamps in whole milliseconds."""
    some = time[:200]
    return next((10.0**-d for d in range(7) if np.allclose(some * 10**d, np.round(some * 10**d), atol=1e-6, rtol=0)), 0.0)


def chosen_rate(stated: float | None, time: Array, name: str, notes: list[str]) -> float:
    """The stated rate where the time column agrees within 1 %, else the time column's; a disagreement is noted."""
    measured = rate_of(time, name)
    if stated is None or not np.isfinite(stated) or stated <= 0:
        if not np.isfinite(measured):
            raise Refused("no_rate", f"{name} states no rate and has one row only", "record longer, or state the rate")
        return measured
    if np.isfinite(measured) and abs(measured / stated - 1) > 0.01:
        notes.append(f"{name} states {stated:g} Hz, its time column says {measured:.4g} Hz; the time column is used")
        return measured
    return stated
