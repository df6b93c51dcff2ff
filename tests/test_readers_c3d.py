"""C3D: frames, units, labels, missing samples, and the child process that guards the reader."""

import builtins
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import c3d as pure
import ezc3d
import numpy as np
import pytest
from make_c3d import write_c3d

from plumbline.errors import Refused
from plumbline.readers import c3d, child, read_file

BODY = np.random.default_rng(1).uniform(0, 1, (20, 6, 3)) * [300, 400, 1700] + 1.0


def refused(path: Path) -> str:
    with pytest.raises(Refused) as caught:
        c3d.read(path)
    return caught.value.reason


@pytest.mark.parametrize(("unit", "scale"), [("mm", 1e-3), ("MM", 1e-3), ("cm", 1e-2), ("m", 1.0), ("mete", 1.0)])
def test_stated_units_are_honoured(tmp_path: Path, unit: str, scale: float) -> None:
    """Positions come out in metres for every unit seen in real files, cut-off names included."""
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", BODY, POINT={"UNITS": unit}))
    np.testing.assert_allclose(raw.points, BODY * scale, rtol=1e-6)


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "mm"), (0.1, "cm"), (1e-3, "m")])
def test_missing_unit_is_told_from_the_size_of_the_body(tmp_path: Path, factor: float, unit: str) -> None:
    """Without a unit a body of 1.7 m allows one unit only, and the notes say which."""
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", BODY * factor, POINT={"UNITS": " "}))
    np.testing.assert_allclose(raw.points, BODY * 1e-3, rtol=1e-6)
    assert any(f"taken as {unit}" in note for note in raw.notes)


def test_ambiguous_unit_is_refused(tmp_path: Path) -> None:
    """Markers that span 0.3 units could be a foot in m or anything else: refused, not guessed."""
    assert refused(write_c3d(tmp_path / "a.c3d", BODY / 6000, POINT={"UNITS": " "})) == "no_unit"


def test_residual_nan_and_zero_are_missing(tmp_path: Path) -> None:
    """Residual -1, NaN and exactly 0,0,0 all read as missing; the other samples stay."""
    points, residual = BODY.copy(), np.zeros(BODY.shape[:2])
    residual[2, 0], points[3, 1], points[4, 2] = -1, np.nan, 0
    points[5, 3, 0] = 0  # one coordinate on an axis plane is a position
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", points, residual=residual))
    missing = np.isnan(raw.points).all(axis=2)
    assert sorted(zip(*(i.tolist() for i in np.nonzero(missing)), strict=True)) == [(2, 0), (3, 1), (4, 2)]


def test_points_that_are_never_valid_are_dropped_and_counted(tmp_path: Path) -> None:
    """A label without one valid sample is no marker, and the notes say how many there were."""
    points = BODY.copy()
    points[:, [1, 4]] = 0
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", points))
    assert raw.labels == ["M0", "M2", "M3", "M5"]
    assert any(note.startswith("2 points are never valid") for note in raw.notes)


def test_time_is_the_files_own(tmp_path: Path) -> None:
    """A file that begins at frame 1469 of a 300 Hz recording begins at 1468/300 s."""
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", BODY, rate=300.0, first=1469))
    np.testing.assert_allclose(raw.time, (1468 + np.arange(20)) / 300)


@pytest.mark.parametrize("keep", [0.5, 0.9, 0.999])
def test_cut_file_is_refused(tmp_path: Path, keep: float) -> None:
    """A file cut anywhere in its data is refused as truncated; ezc3d reads it as a shorter one without an error."""
    path = write_c3d(tmp_path / "a.c3d", np.tile(BODY, (20, 1, 1)))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * keep)])
    assert refused(path) == "truncated"


@pytest.mark.parametrize("lie", [{1: 7}, {2: 3}, {9: 1}])
def test_lying_header_counts_do_not_matter(tmp_path: Path, lie: dict[int, int]) -> None:
    """Wrong numbers of points, analogs or samples in the header: the parameters fill the file and are believed."""
    points, analogs = np.tile(BODY, (10, 1, 1)), np.arange(200 * 5 * 4.0).reshape(1000, 4)
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", points, analogs, header=lie))
    np.testing.assert_allclose(raw.points, points * 1e-3, rtol=1e-6)


@pytest.mark.parametrize("lie", [{"ANALOG": {"RATE": 450.0}}, {"ANALOG": {"USED": 0}}, {"POINT": {"USED": 7}}])
def test_lying_parameters_do_not_shift_the_frames(tmp_path: Path, lie: dict[str, dict[str, float]]) -> None:
    """Where the parameters' layout does not fill the file and the header's does, the points still come out right."""
    points, analogs = np.tile(BODY, (10, 1, 1)), np.arange(200 * 5 * 4.0).reshape(1000, 4)
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", points, analogs, **lie))
    np.testing.assert_allclose(raw.points, points * 1e-3, rtol=1e-6)
    assert any("header and parameters disagree" in note for note in raw.notes)


def test_labels_become_unique_and_more_than_255_are_read(tmp_path: Path) -> None:
    """Repeated labels get .2, empty ones a number, LABELS2 is read on, a single subject's prefix is left out."""
    names = [f"Ann:M{i}" for i in range(300)]
    names[3], names[4], names[5] = "Ann:M2", "", ""
    points = np.tile(BODY[:2, :1], (1, 300, 1)) + np.arange(300)[:, None]
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", points, POINT={"LABELS": names[:255], "LABELS2": names[255:]}, header={1: 300}))
    assert raw.labels[2:7] == ["M2", "M2.2", "unnamed.1", "unnamed.2", "M6"]
    assert raw.labels[-1] == "M299"
    assert len(set(raw.labels)) == 300


def test_model_outputs_are_no_markers(tmp_path: Path) -> None:
    """Angles and powers are left out, listed or only named so; the centre of mass and bone axes are derived points."""
    names = ["LASI", "LKneeAngles", "Odd", "CentreOfMass", "RHipPower", "Hip"]
    extra = {
        "LABELS": names,
        "ANGLES": ["LKneeAngles", "Odd"],
        "MODELED_MARKERS": ["Hip"],
        "TYPE_GROUPS": ["ANGLES", "ANGLE"],
    }
    raw = c3d.read(write_c3d(tmp_path / "a.c3d", BODY, POINT=extra))
    assert raw.labels == ["LASI"]
    assert set(raw.derived) == {"CentreOfMass", "Hip"}
    np.testing.assert_allclose(raw.derived["CentreOfMass"], BODY[:, 3] * 1e-3, rtol=1e-6)
    assert any("LKneeAngles, Odd, RHipPower" in note for note in raw.notes)


def test_no_rate_is_refused(tmp_path: Path) -> None:
    """A file that states no rate anywhere is refused, not given one."""
    assert refused(write_c3d(tmp_path / "a.c3d", BODY, rate=0.0)) == "no_rate"


def test_other_byte_order_is_refused_with_what_to_do(tmp_path: Path) -> None:
    """A MIPS file is named as such and the person told to re-export it."""
    with pytest.raises(Refused, match=r"MIPS.*re-export"):
        c3d.read(write_c3d(tmp_path / "a.c3d", BODY, processor=86))


def test_every_file_that_both_libraries_read_has_equal_values(shared_data: Path) -> None:
    """Every public C3D that ezc3d and the package c3d both read is read here, with equal markers, scale included; only
    a file without any valid marker or plate is not.
    """
    compared, without = 0, set()
    for path in sorted(p for p in shared_data.rglob("*") if p.suffix.lower() == ".c3d" and "hidden" not in str(p)):
        theirs = _by_both(path)
        if theirs is None:
            continue
        try:
            raw = read_file(path)
        except Refused as error:
            without.add((path.name, error.reason))
            continue
        assert len(raw.time) == len(theirs), path.name
        assert _equal(raw.points, theirs), path.name
        compared += raw.points.shape[1] > 0
    assert without <= {("1123x01EMG.c3d", "no_data"), ("sample_16_giant.c3d", "no_data")}
    assert compared >= 25


def _by_both(path: Path) -> np.ndarray | None:
    """Points of the package c3d, shape (n, m, 5), where ezc3d opens the file too."""
    with warnings.catch_warnings(), path.open("rb") as file:
        warnings.simplefilter("ignore")
        try:
            frames = [frame[1] for frame in pure.Reader(file).read_frames()]
            ezc3d.c3d(str(path))
        except Exception:  # each library fails in its own ways
            return None
    return np.array(frames)


def _equal(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Each of our markers is one of their points, in order, in m or mm throughout, missing samples included."""
    missing = (theirs[..., 3:4] < 0) | (theirs[..., :3] == 0).all(axis=2, keepdims=True)
    xyz = np.where(missing, np.nan, theirs[..., :3])
    return any(_follows(ours, xyz * scale) for scale in (1.0, 1e-3))


def _follows(ours: np.ndarray, theirs: np.ndarray) -> bool:
    rest = iter(range(theirs.shape[1]))
    return all(any(np.allclose(ours[:, i], theirs[:, j], rtol=1e-5, atol=1e-6, equal_nan=True) for j in rest) for i in range(ours.shape[1]))


def test_child_returns_what_the_function_returns_and_raises_its_refusal(tmp_path: Path) -> None:
    """A file read in the child is the file read here, and a Refused arrives with its reason."""
    path = write_c3d(tmp_path / "ключ.c3d", BODY)
    np.testing.assert_array_equal(read_file(path).points, c3d.read(path).points)
    path.write_bytes(b"")
    with pytest.raises(Refused, match="no bytes"):
        child.guarded(c3d.read, path)


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ((builtins.bytearray, 3_000_000_000), "too_large"),
        ((time.sleep, 30, 1.2e9, 0.3), "timeout"),
        ((signal.raise_signal, int(signal.SIGABRT)), "unreadable"),
        ((builtins.int, "x"), "unreadable"),
    ],
)
def test_child_that_takes_too_much_is_refused_and_the_next_file_is_read(call: tuple, reason: str) -> None:
    """Memory, time, a crash and any other error end in a reason; the next request is served as if nothing was."""
    with pytest.raises(Refused) as caught:
        child.guarded(*call)
    assert caught.value.reason == reason
    assert child.guarded(builtins.int, "3") == 3


def test_memory_is_watched_where_the_system_has_no_limit() -> None:
    """A child without an address limit is stopped when its resident memory passes what is allowed."""
    watched = child._Child()
    answer, stopped = watched.ask(("numpy:ones", 150_000_000, 64e9), 4e8, 30.0)
    assert answer is None
    assert stopped == "too_large"
    assert watched.process.poll() is not None


def test_one_child_serves_many_files() -> None:
    """Requests in sequence reach the same process."""
    assert child.guarded("os:getpgid", 0) == child.guarded("os:getpgid", 0)
    first = child._current().process.pid
    child.guarded(builtins.int, "3")
    assert child._current().process.pid == first


def test_child_imports_no_pandas() -> None:
    """A child that serves C3D starts lean: neither pandas nor scipy is loaded."""
    code = "import sys, plumbline.readers.child, plumbline.readers.c3d; print({'pandas', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
