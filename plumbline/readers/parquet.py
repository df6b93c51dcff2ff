"""Parquet with named columns: what they are comes from `columns:` in the config."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from plumbline.errors import Refused
from plumbline.readers.columns import Entry, Table, entry_for, to_raw
from plumbline.readers.raw import Raw


def read(path: Path, columns: Sequence[Entry]) -> Raw:
    """One parquet file by its entry of the config.

    Raises Refused: unsupported (no entry), empty_file, unreadable, no_column, no_unit, no_rate, bad_time.
    """
    entry = entry_for(path, columns)
    if path.stat().st_size == 0:
        raise Refused("empty_file", f"{path.name} holds no bytes", "export it again")
    try:
        values = pq.read_table(path).to_pandas()
    except (pa.ArrowException, OSError) as error:
        raise Refused("unreadable", f"{path.name} is no whole parquet file: {error}", "export it again") from error
    if values.empty:
        raise Refused("empty_file", f"{path.name} has no rows", "export it again")
    return to_raw(Table(path.name, [str(c) for c in values.columns], values, entry), [])
