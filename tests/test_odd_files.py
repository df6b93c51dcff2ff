"""All odd, broken and unusual public files: each is read or refused as the committed table `odd_files.tsv` expects."""

import csv
import sys
from pathlib import Path
from typing import Any

import pytest

from plumbline.errors import Refused
from plumbline.readers import child, read_file
from plumbline.readers.raw import Raw

TABLE = Path(__file__).with_name("odd_files.tsv")
with TABLE.open(encoding="utf-8", newline="") as _file:
    ROWS = list(csv.DictReader(_file, delimiter="\t"))
ABOUT = ("README.md", "LICENSE")  # files that describe the folder


def counts(raw: Raw) -> dict[str, str]:
    """Markers, frames (samples of the first plate where there are no markers' frames) and plates, as in the table."""
    frames = len(raw.time) if len(raw.time) or not raw.plates else len(raw.plates[0].time)
    return {"markers": str(len(raw.labels)), "frames": str(frames), "plates": str(len(raw.plates))}


@pytest.mark.parametrize("row", ROWS, ids=[row["file"] for row in ROWS])
def test_odd_file_is_read_or_refused_as_the_table_says(shared_data: Path, row: dict[str, str]) -> None:
    """The pipeline's own entry reads the file with the counts of the table, or refuses it with its reason."""
    path = shared_data / row["file"]
    if row["outcome"] == "refused":
        with pytest.raises(Refused) as caught:
            read_file(path)
        assert caught.value.reason == row["reason"]
        assert path.name in caught.value.message
        assert caught.value.hint
    else:
        assert counts(read_file(path)) == {name: row[name] for name in ("markers", "frames", "plates")}


@pytest.mark.parametrize("folder", ["c3d_odd", "nimble_odd"])
def test_every_odd_file_is_in_the_table(shared_data: Path, folder: str) -> None:
    """No file of the folders is missing in the table, and the table names none that is not there."""
    files = {p.relative_to(shared_data).as_posix() for p in (shared_data / folder).rglob("*") if p.is_file()}
    described = {file for file in files if not Path(file).name.startswith(ABOUT)}
    assert described == {row["file"] for row in ROWS if row["file"].startswith(folder + "/")}


@pytest.mark.skipif(sys.platform != "linux", reason="peak memory in kB as Linux counts it")
def test_no_process_takes_more_than_a_gigabyte_and_a_half(shared_data: Path) -> None:
    """The file that makes the bare library take 12.6 GB is refused with neither the child nor this process above 1.5 GB."""
    import resource  # not on Windows

    path = shared_data / "c3d_odd" / "sample18_bad_parameter_section.c3d"
    with pytest.raises(Refused, match="damaged"):
        read_file(path)
    peaks: list[Any] = [child.guarded("resource:getrusage", resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_SELF)]
    assert all(peak.ru_maxrss < 1.5e6 for peak in peaks)
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 1.5e6


@pytest.mark.parametrize("name", ["sample02_DEC_INT.C3D", "sample02_Dec_real.c3d", "sample02_pc_int.c3d"])
def test_one_recording_in_four_encodings_is_one_recording(shared_data: Path, name: str) -> None:
    """DEC or PC, integers or reals: markers agree to the integers' resolution of 0.28 mm, forces to 1e-3 N."""
    one, other = (read_file(shared_data / "c3d_odd" / file) for file in (name, "sample02_pc_real.c3d"))
    assert one.labels == other.labels
    assert abs(one.points - other.points)[other.points == other.points].max() < 0.3e-3
    for mine, theirs in zip(one.plates, other.plates, strict=True):
        assert abs(mine.force - theirs.force).max() < 1e-3
