"""References are compared by named columns with a tolerance each."""

from pathlib import Path

import pandas as pd
import pytest

from plumbline.errors import PlumblineError
from plumbline.papers import compare, freeze

ABOUT = {"keys": ["subject"], "columns": {"omega": {"rel": 1e-6}, "offset": {"abs": 1e-5}}}


def drift(tmp_path: Path, **change: float) -> dict[str, bool]:
    old = pd.DataFrame({"subject": ["a", "b"], "omega": [3.0, 2.9], "offset": [0.0, float("nan")]})
    old.to_parquet(tmp_path / "x.parquet")
    freeze(tmp_path / "x.csv", tmp_path / "x.parquet", ABOUT)
    new = old.copy()
    for column, by in change.items():
        new.loc[0, column] += by
    new.to_parquet(tmp_path / "y.parquet")
    lines = compare(tmp_path / "x.csv", tmp_path / "y.parquet", ABOUT)
    return {line.split(":")[0]: fine for line, fine in lines}


def test_the_same_numbers_pass_and_the_last_digits_may_differ(tmp_path: Path) -> None:
    """No drift, or one below the tolerance, is fine; NaN equals NaN."""
    assert all(drift(tmp_path).values())
    assert all(drift(tmp_path, omega=1e-9, offset=9e-6).values())


def test_a_drift_beyond_the_tolerance_of_its_column_fails(tmp_path: Path) -> None:
    """Only the column that drifts fails."""
    assert drift(tmp_path, omega=1e-4) == {"2 rows": True, "omega": False, "offset": True}


def test_lost_rows_fail_and_absent_files_are_named(tmp_path: Path) -> None:
    """A subject less is a difference; a result that is not there is said."""
    drift(tmp_path)
    pd.read_parquet(tmp_path / "y.parquet").iloc[:1].to_parquet(tmp_path / "z.parquet")
    assert not next(compare(tmp_path / "x.csv", tmp_path / "z.parquet", ABOUT))[1]
    with pytest.raises(PlumblineError, match="run the study first"):
        list(compare(tmp_path / "x.csv", tmp_path / "none.parquet", ABOUT))
