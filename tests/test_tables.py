"""Tables are written in pieces and read by trial; what is wrong is named; a killed job leaves no half file."""

from pathlib import Path

import pandas as pd
import pytest

from plumbline import tables
from plumbline.errors import PlumblineError


def rows(trial: str, n: int) -> pd.DataFrame:
    blank = {c.name: {"str": "", "int": 1, "float": 0.5, "bool": False}[c.kind] for c in tables.TABLES["plates"]}
    return pd.DataFrame([blank | {"trial": trial, "sample": i} for i in range(n)])


def test_pieces_make_the_table_and_a_trial_is_read_alone(tmp_path: Path) -> None:
    """Two pieces are one table; asking for a trial gives its rows only."""
    file = tmp_path / "deep" / "x.parquet"
    with tables.Writer("plates", file, tables.Stamp("abc", {"k": 1})) as out:
        out.append(rows("a", 3))
        out.append(rows("b", 2))
    assert list(tables.read("plates", file)["trial"]) == ["a"] * 3 + ["b"] * 2
    assert len(tables.read("plates", file, trial="b")) == 2
    assert tables.about(file) == {"table": "plates", "code": "abc", "config": {"k": 1}}


def test_a_block_that_fails_leaves_nothing(tmp_path: Path) -> None:
    """Neither the file nor its temporary stand-in."""
    with pytest.raises(PlumblineError), tables.Writer("plates", tmp_path / "x.parquet") as out:
        out.append(rows("a", 3)[["trial"]])
    assert list(tmp_path.iterdir()) == []


def test_wrong_columns_and_wrong_tables_are_named(tmp_path: Path) -> None:
    """A missing and an unknown column; a file of another table."""
    with pytest.raises(PlumblineError, match=r"missing columns \['cop_x'\], unknown columns \['copx'\]"):
        tables.write("plates", rows("a", 1).rename(columns={"cop_x": "copx"}), tmp_path / "x.parquet")
    tables.write("plates", rows("a", 1), tmp_path / "x.parquet")
    with pytest.raises(PlumblineError, match="no table 'markers'"):
        tables.read("markers", tmp_path / "x.parquet")


def test_parts_are_read_in_the_order_of_subjects(tmp_path: Path) -> None:
    """How a cohort is cut into parts does not show in its results."""
    for name, subject in (("1", "sub-02"), ("2", "sub-01")):
        tables.write("plates", rows("t", 2).assign(subject=subject), tmp_path / f"{name}.parquet")
    got = tables.read_all("plates", [tmp_path / "1.parquet", tmp_path / "2.parquet"])
    assert list(got["subject"]) == ["sub-01"] * 2 + ["sub-02"] * 2
    assert tables.read_all("plates", []).empty


def test_every_column_has_a_meaning() -> None:
    """Units and meanings are for the reader of a parquet file."""
    assert [c for columns in tables.TABLES.values() for c in columns if not c.meaning] == []
