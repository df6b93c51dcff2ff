"""Files with their own names are listed, never renamed."""

from pathlib import Path

import pytest

from plumbline.adopt import adopt, expression
from plumbline.errors import PlumblineError
from plumbline.study import find


def test_pattern_to_table_and_back(tmp_path: Path) -> None:
    """The table that adopt writes is the one that find reads; what did not fit is said; nothing in raw/ changes."""
    raw = tmp_path / "raw"
    (raw / "day 1").mkdir(parents=True)
    for name in ("day 1/P-03_quiet_2.c3d", "P04_lateral_1.c3d", "notes.c3d"):
        (raw / name).write_text("x")
    before = sorted(str(p) for p in raw.rglob("*"))
    said = list(adopt(tmp_path, "{participant}_{task}_{run}.c3d"))
    assert said[0].endswith("2 files")
    assert "notes.c3d" in said[1]
    assert [t.trial for t in find(tmp_path).trials] == ["sub-P03_task-quiet_run-2", "sub-P04_task-lateral_run-1"]
    assert sorted(str(p) for p in raw.rglob("*")) == before


def test_an_existing_table_is_not_replaced(tmp_path: Path) -> None:
    """The user's table is kept unless --force is given."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "recordings.tsv").write_text("file\tparticipant_id\ttask\n")
    with pytest.raises(PlumblineError, match="there already"):
        list(adopt(tmp_path, "{participant}_{task}.c3d"))


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ("{subject}.c3d", "known"),
        ("{task}.c3d", "needs"),
        ("{participant}{participant}.c3d", "twice"),
        ("{participant}.c3d", "--task"),
    ],
)
def test_patterns_that_cannot_work(tmp_path: Path, pattern: str, said: str) -> None:
    """Each says what to write instead."""
    (tmp_path / "raw").mkdir()
    with pytest.raises(PlumblineError, match=said):
        list(adopt(tmp_path, pattern))


def test_a_field_takes_no_underscore() -> None:
    """`a_b_1.c3d` is not silently cut in two somewhere."""
    assert expression("{participant}_{run}.c3d").match("a_b_1.c3d") is None


def test_names_that_would_fuse_two_recordings_stop(tmp_path: Path) -> None:
    """Two C3D files may not become one trial."""
    (tmp_path / "raw").mkdir()
    for name in ("ab_fast.c3d", "ab_slow.c3d"):
        (tmp_path / "raw" / name).write_text("x")
    with pytest.raises(PlumblineError, match=r"ab_fast.c3d, ab_slow.c3d would be one trial; tell them apart with \{run\}"):
        list(adopt(tmp_path, "{participant}_*.c3d", task="gait"))
