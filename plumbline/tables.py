"""The one way to write and read the pipeline's tables; their columns are those of :mod:`plumbline.table_columns`.

Files are parquet. Units stand in each column's metadata (``unit``, ``meaning``); the file's own metadata holds the table's
name, the digest of the code that made it and the config section it was made with (both JSON under ``plumbline``).
"""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from plumbline.errors import PlumblineError
from plumbline.table_columns import KEY, OPEN, TABLES, Column

__all__ = [
    "KEY",
    "NO_STAMP",
    "OPEN",
    "TABLES",
    "Column",
    "Stamp",
    "Writer",
    "about",
    "empty",
    "joined",
    "read",
    "read_all",
    "schema",
    "to_csv",
    "write",
]


class Stamp(NamedTuple):
    """Who made a table: digest of the code, the config section."""

    code: str = ""
    config: Mapping[str, Any] | None = None


_ARROW = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}


def schema(name: str, more: Iterable[str] = ()) -> pa.Schema:
    """Arrow schema of a table, with unit and meaning of each column in its metadata.  more: columns of an open table."""
    meaning, unit = OPEN.get(name, ("", ""))
    columns = [*TABLES[name], *(Column(k, "float", unit, meaning) for k in more)]
    return pa.schema([pa.field(c.name, _ARROW[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns])


def empty(name: str) -> pd.DataFrame:
    """A table without rows."""
    return pd.DataFrame(schema(name).empty_table().to_pandas())


def joined(name: str, parts: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """One table of several pieces; the table without rows where all are empty."""
    rows = [p for p in parts if len(p)]
    return pd.concat(rows, ignore_index=True) if rows else empty(name)


NO_STAMP = Stamp()


class Writer:
    """Writes a table piece by piece, so that a part need not fit into memory.

    The file gets its name when the block ends well: a killed job leaves no half file.
    """

    def __init__(self, name: str, path: str | Path, stamp: Stamp = NO_STAMP, more: Iterable[str] = ()) -> None:
        self.name, self.target = name, Path(path)
        self.temporary = self.target.with_name(f".{self.target.name}.{os.getpid()}")
        about = {"table": name, "code": stamp.code, "config": stamp.config or {}}
        self.schema = schema(name, more).with_metadata({"plumbline": json.dumps(about, sort_keys=True)})

    def __enter__(self) -> "Writer":
        self.target.parent.mkdir(parents=True, exist_ok=True)
        text = [c.name for c in TABLES[self.name] if c.kind == "str"]  # numbers hardly repeat: a dictionary of them only costs time
        self.file = pq.ParquetWriter(self.temporary, self.schema, compression="zstd", use_dictionary=text)
        return self

    def append(self, frame: pd.DataFrame) -> None:
        """Add rows.  Raises PlumblineError where the columns are not those of :data:`TABLES`."""
        want, have = self.schema.names, list(frame.columns)
        if set(want) != set(have):
            lacks, more = sorted(set(want) - set(have)), sorted(set(have) - set(want))
            raise PlumblineError(f"table {self.name}: missing columns {lacks}, unknown columns {more}")
        self.file.write_table(pa.Table.from_pandas(frame[want], schema=self.schema, preserve_index=False))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.file.close()
        if kind is None:
            self.temporary.replace(self.target)
        else:
            self.temporary.unlink()


def write(name: str, frame: pd.DataFrame, path: str | Path, stamp: Stamp = NO_STAMP) -> None:
    """Write a whole table.  Raises PlumblineError where the columns are not those of :data:`TABLES`."""
    own = {c.name for c in TABLES[name]}
    more = [k for k in frame.columns if k not in own] if name in OPEN else []
    with Writer(name, path, stamp, more) as out:
        if len(frame.columns):
            out.append(frame)


def read(name: str, path: str | Path, columns: list[str] | None = None, trial: str = "") -> pd.DataFrame:
    """Read one file of a table: all of it, some of its columns, or the rows of one trial."""
    if about(path).get("table") != name:
        raise PlumblineError(f"{path} is no table '{name}'; delete results/ and run again")
    chosen = [("trial", "=", trial)] if trial else None
    return pd.DataFrame(pq.read_table(path, columns=columns, filters=chosen).to_pandas())


def read_all(name: str, paths: Iterable[str | Path], columns: list[str] | None = None) -> pd.DataFrame:
    """Read all parts of a table, in the order of subjects and not of parts: a cohort's result does not depend on its cutting."""
    frames = [read(name, p, columns) for p in paths]
    if not frames:
        return empty(name)
    table = pd.concat(frames, ignore_index=True)
    by = [c for c in ("subject", "trial") if c in table]
    return table.sort_values(by, kind="stable", ignore_index=True) if by else table


def to_csv(name: str, paths: Iterable[str | Path], target: str | Path) -> None:
    """Write all parts of a table as one .csv, part by part."""
    empty(name).to_csv(target, index=False)
    for path in paths:
        read(name, path).to_csv(target, index=False, mode="a", header=False)


def about(path: str | Path) -> dict[str, Any]:
    """What a file says of itself: table, code digest, config section."""
    return dict(json.loads((pq.read_schema(path).metadata or {}).get(b"plumbline", b"{}")))
