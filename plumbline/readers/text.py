"""Delimited text (.csv, .txt, .tsv, ...): what the columns are comes from `columns:` in the config."""

from collections.abc import Sequence
from pathlib import Path

from plumbline.errors import Refused
from plumbline.readers import numbers
from plumbline.readers.columns import Entry, Table, entry_for, to_raw
from plumbline.readers.raw import Raw

DELIMITERS = {"tab": "\t", "comma": ",", "semicolon": ";", "space": None}


def read(path: Path, columns: Sequence[Entry]) -> Raw:
    """One text file by its entry of the config.

    Raises Refused: unsupported (no entry), empty_file, unreadable, truncated, no_column, no_unit, no_rate, bad_time.
    """
    entry = entry_for(path, columns)
    lines, ended, notes = numbers.decode(path)
    delimiter = str(entry.get("delimiter", "auto"))
    first = int(entry["header"]) if "header" in entry else _first_row(lines, delimiter, path.name)
    if first >= len(lines):
        raise Refused("empty_file", f"{path.name} has no rows after its {first} header lines", "correct `header:` or export again")
    sep = numbers.separator(lines[first]) if delimiter == "auto" else DELIMITERS[delimiter]
    rows = [line for line in lines[first:] if line.strip()]
    values = numbers.frame(rows, sep, ended, path.name)
    names = _names(lines[:first], sep)
    return to_raw(Table(path.name, names[: values.shape[1]], values, entry), notes)


def _first_row(lines: list[str], delimiter: str, name: str) -> int:
    """Index of the first line that holds numbers only (blanks allowed)."""
    for i, line in enumerate(lines[:200]):
        sep = numbers.separator(line) if delimiter == "auto" else DELIMITERS[delimiter]
        cells = [c for c in numbers.fields(line, sep) if c and c not in numbers.MISSING]
        if cells and all(_is_number(c) for c in cells):
            return i
    raise Refused(
        "unreadable",
        f"{name}: no line of numbers in the first 200",
        "state `delimiter:` and `header:` (lines before the numbers)",
    )


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _names(header: list[str], sep: str | None) -> list[str]:
    """Column names: the last header line that is not blank."""
    full = [line for line in header if line.strip()]
    return numbers.fields(full[-1].lstrip("#%"), sep) if full else []
