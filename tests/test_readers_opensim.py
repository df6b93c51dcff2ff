"""TRC, MOT and STO: what real files do, and what happens to broken ones."""

from pathlib import Path

import numpy as np
import pytest

from plumbline.errors import Refused
from plumbline.readers.opensim import read, read_storage, read_trc

POINTS = np.arange(30, dtype=float).reshape(5, 2, 3) + 1.0


def trc(
    path: Path,
    *,
    points: np.ndarray = POINTS,
    labels: str = "A\t\t\tB\t\t",
    units: str = "mm",
    rate: str = "100",
    frames: str = "5",
    markers: str = "2",
    time: np.ndarray | None = None,
    newline: str = "\n",
    values: str | None = None,
    cells: list[list[str]] | None = None,
) -> Path:
    """Write a TRC file; every part can be made odd."""
    t = 0.01 * np.arange(len(points)) if time is None else time
    rows = cells or [[f"{v:.5f}" for v in p.reshape(-1)] for p in points]
    lines = [
        "PathFileType\t4\t(X/Y/Z)\tx.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        values or "\t".join([rate, rate, frames, markers, units, rate, "1", frames]),
        "Frame#\tTime\t" + labels,
        "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
        "",
        *("\t".join([str(i + 1), f"{s:.6g}", *row]) for i, (s, row) in enumerate(zip(t, rows, strict=True))),
    ]
    path.write_bytes((newline.join(lines) + newline).encode())
    return path


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("labels", ["A\t\t\tB\t\t", "\tA\t\tB\t", "A\t\t\tB\t\t\t\t\t"])
def test_line_ends_and_both_styles_of_labels(tmp_path: Path, newline: str, labels: str) -> None:
    """CRLF, CR and LF, labels every three or every two tabs, padded or not: the same markers in metres."""
    raw = read_trc(trc(tmp_path / "a.trc", newline=newline, labels=labels))
    assert raw.labels == ["A", "B"]
    assert raw.rate == 100.0
    np.testing.assert_allclose(raw.points, POINTS / 1000)


@pytest.mark.parametrize(("units", "scale"), [("mm", 1e-3), ("MM", 1e-3), ("m", 1.0), ("cm", 1e-2), (" meters", 1.0)])
def test_units(tmp_path: Path, units: str, scale: float) -> None:
    """The unit of the header is honoured however it is written."""
    np.testing.assert_allclose(read_trc(trc(tmp_path / "a.trc", units=units)).points, POINTS * scale)


@pytest.mark.parametrize("units", ["", "furlong"])
def test_no_unit(tmp_path: Path, units: str) -> None:
    """No unit or an unknown one is refused by name, never guessed."""
    with pytest.raises(Refused) as caught:
        read_trc(trc(tmp_path / "a.trc", units=units))
    assert caught.value.reason == "no_unit"
    assert "a.trc" in caught.value.message


def test_missing_markers_in_every_spelling(tmp_path: Path) -> None:
    """Blank, NaN in any case, and exactly 0, 0, 0 are missing; numbers in E format are numbers."""
    cells = [
        ["", "", "", "1E+00", "2.0e0", "3"],
        ["NaN", "nan", "NAN", "1", "2", "3"],
        ["Nan", "naN", "nAn", "1", "2", "3"],
        ["0", "0.0", "0.000", "1", "2", "3"],
        ["4", "5", "6", "1", "2", "3 "],
    ]
    raw = read_trc(trc(tmp_path / "a.trc", cells=cells))
    assert np.isnan(raw.points[:4, 0]).all()
    np.testing.assert_allclose(raw.points[4, 0], [0.004, 0.005, 0.006])
    np.testing.assert_allclose(raw.points[:, 1], np.tile([0.001, 0.002, 0.003], (5, 1)))


def test_a_word_among_the_numbers_is_named(tmp_path: Path) -> None:
    """A cell that is no number is refused with its column and row."""
    cells = [["1", "2", "3", "4", "5", "6"] for _ in range(5)]
    cells[2][3] = "lost"
    with pytest.raises(Refused, match=r"column 6, row 3 .*'lost'") as caught:
        read_trc(trc(tmp_path / "a.trc", cells=cells))
    assert caught.value.reason == "unreadable"


def test_counts_that_lie_are_noted_not_believed(tmp_path: Path) -> None:
    """27,107 stated frames with five there: five are read, and the notes say so; the same for markers."""
    raw = read_trc(trc(tmp_path / "a.trc", frames="27107", markers="28"))
    assert raw.points.shape == (5, 2, 3)
    assert any("27107" in n for n in raw.notes)
    assert any("28 markers" in n for n in raw.notes)


def test_more_labels_than_columns(tmp_path: Path) -> None:
    """Labels without columns are dropped with a note; columns keep their own labels."""
    raw = read_trc(trc(tmp_path / "a.trc", labels="A\t\t\tB\t\t\tC\t\t\tD\t\t"))
    assert raw.labels == ["A", "B"]
    assert any("C, D" in n for n in raw.notes)


def test_blank_label_keeps_its_place(tmp_path: Path) -> None:
    """A marker without a name does not shift the names behind it."""
    raw = read_trc(trc(tmp_path / "a.trc", labels="\t\t\tB\t\t"))
    assert raw.labels == ["unnamed1", "B"]


def test_repeated_labels_get_a_number(tmp_path: Path) -> None:
    """Two markers of one name stay two markers."""
    assert read_trc(trc(tmp_path / "a.trc", labels="A\t\t\tA\t\t")).labels == ["A", "A.2"]


def test_header_values_with_doubled_tabs(tmp_path: Path) -> None:
    """A spreadsheet's doubled tabs between header values do not shift the unit."""
    raw = read_trc(trc(tmp_path / "a.trc", values="100\t\t100\t\t5\t\t2\t\t mm\t100\t1\t5\t\t\t"))
    np.testing.assert_allclose(raw.points, POINTS / 1000)


@pytest.mark.parametrize("cut", [3, 12, 30])
def test_a_cut_last_line_is_refused(tmp_path: Path, cut: int) -> None:
    """A file that ends inside a row is refused as truncated, wherever in the row it was cut."""
    path = trc(tmp_path / "a.trc", frames="9")
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(Refused) as caught:
        read_trc(path)
    assert caught.value.reason == "truncated"


def test_a_file_without_the_last_line_end_is_whole(tmp_path: Path) -> None:
    """All stated rows there and only the last line end missing: that is no cut."""
    path = trc(tmp_path / "a.trc")
    path.write_bytes(path.read_bytes()[:-1])
    assert len(read_trc(path).points) == 5


def test_trailing_blanks_of_a_missing_last_marker_may_be_dropped(tmp_path: Path) -> None:
    """A writer that strips the tabs of a missing last marker cuts nothing."""
    cells = [[f"{v:.3f}" for v in p.reshape(-1)] for p in POINTS]
    cells[-1] = cells[-1][:3]
    raw = read_trc(trc(tmp_path / "a.trc", cells=cells))
    assert np.isnan(raw.points[-1, 1]).all()
    np.testing.assert_allclose(raw.points[-1, 0], POINTS[-1, 0] / 1000)


def test_time_column_beats_a_wrong_rate(tmp_path: Path) -> None:
    """A down-sampled file that still states the old rate gets the rate of its time column, with a note."""
    raw = read_trc(trc(tmp_path / "a.trc", rate="250", time=0.5 + 0.04 * np.arange(5)))
    assert raw.rate == pytest.approx(25.0)
    assert raw.time[0] == 0.5
    assert any("250 Hz" in n for n in raw.notes)


def test_time_that_turns_back(tmp_path: Path) -> None:
    """Time that does not increase is refused with the row."""
    with pytest.raises(Refused, match="after row 2") as caught:
        read_trc(trc(tmp_path / "a.trc", time=np.array([0, 0.01, 0.01, 0.02, 0.03])))
    assert caught.value.reason == "bad_time"


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "empty_file"), (b"  \n", "empty_file"), (b"\x00\x01\x02" * 50, "unreadable"), (b"hello\nworld\n", "unreadable")],
)
def test_no_trc_at_all(tmp_path: Path, content: bytes, reason: str) -> None:
    """Nothing, blanks, bytes and prose each get their reason."""
    path = tmp_path / "a.trc"
    path.write_bytes(content)
    with pytest.raises(Refused) as caught:
        read(path)
    assert caught.value.reason == reason


def test_a_label_outside_ascii(tmp_path: Path) -> None:
    """Names in Latin-1 are read, with a note on the encoding; UTF-8 needs none."""
    path = trc(tmp_path / "a.trc", labels="Ferse_lö\t\t\tB\t\t")
    assert read_trc(path).labels[0] == "Ferse_lö"
    path.write_bytes(path.read_bytes().decode().encode("latin-1"))
    raw = read_trc(path)
    assert raw.labels[0] == "Ferse_lö"
    assert any("Latin-1" in n for n in raw.notes)


# -- MOT and STO ------------------------------------------------------------------------------------------------------

STYLES = {
    "numbered": ["ground_force_1_{v}{a}", "ground_force_1_{p}{a}", "ground_force_1_{m}{a}"],
    "prefixed": ["1_ground_force_v{a}", "1_ground_force_p{a}", "1_ground_torque_{a}"],
    "plain": ["ground_force_v{a}", "ground_force_p{a}", "ground_torque_{a}"],
    "right": ["ground_force_r_v{a}", "ground_force_r_p{a}", "ground_torque_r_{a}"],
    "R_first": ["R_ground_force_v{a}", "R_ground_force_p{a}", "R_ground_torque_{a}"],
    "moment": ["ground_force_2_v{a}", "ground_force_2_p{a}", "ground_moment_2_m{a}"],
    "sto": ["f1_{n}", "p1_{n}", "m1_{n}"],
}
FORCE = np.column_stack([np.linspace(-5, 5, 20), np.full(20, 600.0), np.linspace(3, -3, 20)])
POINT = np.column_stack([np.linspace(0.1, 0.2, 20), np.full(20, 0.006), np.linspace(-0.3, -0.2, 20)])
FREE = np.column_stack([np.zeros(20), np.linspace(-1, 1, 20), np.zeros(20)])
HEADERS = {
    "opensim": "nColumns=10\nnRows=20\nDataType=double\nversion=3\nOpenSimVersion=4.1\nendheader\n",
    "sto": "name x.sto\ndatacolumns 10\ndatarows 20\nrange 0 0.19\nendheader\n",
    "prose": "Coordinates\nversion=1\nnRows=20\nnColumns=10\ninDegrees=yes\n\nUnits are S.I. units\n\nendheader\n",
    "blank line after": "name C:\\x.mot\ndatacolumns 10\ndatarows 20\nendheader \n\n",
    "none": "",
}


def storage(path: Path, *, style: str = "numbered", header: str = "opensim", sep: str = "\t", scale: float = 1.0) -> Path:
    """Write a MOT file with one plate."""
    names = [
        t.format(a=a, n=i + 1, v="v", p="p", m="m") for t in STYLES[style] for i, a in enumerate("xyz")
    ]  # fmt: skip
    data = np.column_stack([0.001 + 0.01 * np.arange(20), FORCE, POINT * scale, FREE * scale])
    rows = [sep.join(["time", *names]), *(sep.join(f"{v:.8f}" for v in row) for row in data)]
    path.write_text(HEADERS[header] + "\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("style", list(STYLES))
@pytest.mark.parametrize("header", list(HEADERS))
def test_styles_of_names_and_headers(tmp_path: Path, style: str, header: str) -> None:
    """Each naming style and header gives the same plate, and the wrench holds the CoP that was written."""
    raw = read_storage(storage(tmp_path / "a.mot", style=style, header=header))
    (plate,) = raw.plates
    assert raw.rate == pytest.approx(100.0)
    assert plate.time[0] == pytest.approx(0.001)
    assert plate.foot == ("right" if style in ("right", "R_first") else "")
    np.testing.assert_allclose(plate.force, FORCE, atol=1e-8)
    np.testing.assert_allclose(np.cross(POINT - plate.origin, FORCE) + FREE, plate.moment, atol=1e-5)


def test_blanks_instead_of_tabs(tmp_path: Path) -> None:
    """Columns that blanks align are read like tabs."""
    np.testing.assert_allclose(read_storage(storage(tmp_path / "a.mot", sep="   ")).plates[0].force, FORCE, atol=1e-8)


def test_points_in_mm_are_seen(tmp_path: Path) -> None:
    """A storage file states no unit: points hundreds of metres away can only be mm, and the note says so."""
    metres, mm = (read_storage(storage(tmp_path / f"{s}.mot", scale=s)) for s in (1.0, 1000.0))
    np.testing.assert_allclose(mm.plates[0].moment, metres.plates[0].moment, atol=1e-4)
    np.testing.assert_allclose(mm.plates[0].origin, metres.plates[0].origin, atol=1e-9)
    assert any("mm" in n for n in mm.notes)
    assert not metres.notes


def test_a_plate_of_zeros_is_left_out_with_a_note(tmp_path: Path) -> None:
    """The empty third block of a file is no plate."""
    path = storage(tmp_path / "a.mot")
    head, body = path.read_text().split("endheader\n")
    lines = body.splitlines()
    extra = [n.replace("_1_", "_3_") for n in lines[0].split("\t")[1:]]
    lines = ["\t".join([lines[0], *extra]), *("\t".join([line, *["0"] * 9]) for line in lines[1:])]
    path.write_text(head + "endheader\n" + "\n".join(lines) + "\n")
    raw = read_storage(path)
    assert len(raw.plates) == 1
    assert any("'3'" in n and "zeros" in n for n in raw.notes)


def test_joint_angles_are_no_forces(tmp_path: Path) -> None:
    """A MOT file of joint angles is refused with what it holds."""
    path = tmp_path / "ik.mot"
    path.write_text("nRows=2\nendheader\ntime\tpelvis_tilt\tpelvis_tx\n0\t1\t2\n0.1\t1\t2\n")
    with pytest.raises(Refused, match="pelvis_tilt") as caught:
        read(path)
    assert caught.value.reason == "no_data"


def test_a_cut_storage_file(tmp_path: Path) -> None:
    """A MOT file that ends inside a row is refused as truncated."""
    path = storage(tmp_path / "a.mot")
    path.write_bytes(path.read_bytes()[:-25])
    with pytest.raises(Refused) as caught:
        read(path)
    assert caught.value.reason == "truncated"


# -- real files -------------------------------------------------------------------------------------------------------


def test_every_shared_file_is_read_or_refused_with_a_reason(shared_data: Path) -> None:
    """All TRC, MOT and STO files of the public data are read but the one that holds joint angles only."""
    files = [f for f in sorted(shared_data.glob("*/*")) if f.suffix in (".trc", ".mot", ".sto")]
    refused = {}
    for file in files:
        try:
            raw = read(file)
        except Refused as refusal:
            refused[file.name] = refusal.reason
            continue
        assert raw.rate > 0
        assert raw.plates or np.isfinite(raw.points).any()
    assert len(files) > 20
    assert refused == {"gait10dof18musc_ik_CRLF_line_ending.mot": "no_data"}


def test_opensim_wrench_about_two_origins(shared_data: Path) -> None:
    """OpenSim's export about the plate's centre and the one about the CoP are one wrench: the CoP agrees within 1 mm."""
    cops = []
    for name in ("std_walking2_grfs.sto", "std_cop_walking2_grfs.sto"):
        plate = read_storage(shared_data / "opensim" / name).plates[0]
        on = np.abs(plate.force[:, 2]) > 100
        cops.append(plate.origin[:2] + np.column_stack([-plate.moment[on, 1], plate.moment[on, 0]]) / plate.force[on, 2:])
    np.testing.assert_allclose(cops[0], cops[1], atol=1e-3)
