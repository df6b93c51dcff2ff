"""Force plates: the wrench a person put on the plate comes back, whatever the type, unit, sign or offset of the file.

Free body: a force F acts at the point c of the surface, with a free moment T about the vertical. The plate's axes have
z into the floor; its sensors sit d = 40 mm below the surface, o = (0, 0, -d) points from them to the surface.
    about the surface's centre: M = c x F + (0, 0, T)        about the sensors: M' = M + o x F
"""

from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pytest
from make_c3d import PLATE, write_c3d

from plumbline.readers import c3d
from plumbline.readers.raw import Raw, RawPlate

N, PER_FRAME = 60, 5
BODY = np.random.default_rng(2).uniform(0, 1, (N, 6, 3)) * [300, 400, 1700] + 1.0
T = np.linspace(0, 2 * np.pi, N * PER_FRAME)
LOAD = np.clip(20 * np.sin(T / 2) - 4, 0, 1)[:, None]  # nobody, somebody, nobody
FORCE = LOAD * np.stack([40 * np.sin(T), -30 * np.cos(T), -700 + 50 * np.sin(3 * T)], axis=1)  # plate axes: z down
COP = np.stack([0.08 * np.cos(T), 0.15 * np.sin(T), 0 * T], axis=1)
FREE = LOAD[:, 0] * 3 * np.sin(2 * T)
MOMENT = np.cross(COP, FORCE) + FREE[:, None] * [0, 0, 1]
ORIGIN = np.array([0, 0, -0.04])
AXES = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])  # plate to lab, for the corners of make_c3d.PLATE


def sensors(kind: int) -> np.ndarray:
    """The channels of a plate type in N and N m, without offsets (type 3: sensors at +-0.12, +-0.2 m)."""
    about = MOMENT + np.cross(ORIGIN, FORCE)
    if kind == 1:
        return np.column_stack([FORCE, 1e3 * COP[:, :2], 1e3 * FREE])
    if kind == 3:
        a, b = 0.12, 0.2
        quarter, roll, pitch = FORCE[:, 2] / 4, about[:, 0] / (4 * b), about[:, 1] / (4 * a)
        twist = about[:, 2] / b
        x12, x34 = FORCE[:, 0] / 2 - twist / 2, FORCE[:, 0] / 2 + twist / 2
        y14 = y23 = FORCE[:, 1] / 2
        z = [quarter + roll - pitch, quarter + roll + pitch, quarter - roll + pitch, quarter - roll - pitch]
        return np.column_stack([x12, x34, y14, y23, *z])
    return np.column_stack([FORCE, about])


def read(path: Path, values: np.ndarray, kind: int = 2, plate: dict[str, Any] | None = None, **groups: Any) -> Raw:
    """Write one plate with these channel values and read the file."""
    count = values.shape[1]
    described = {"TYPE": np.array([kind]), "CHANNEL": np.arange(1, count + 1)[:, None], **(plate or {})}
    units = ["N", "N", "N", "Nm", "Nm", "Nm", "N", "N"][:count]
    groups["ANALOG"] = {"UNITS": units, **groups.get("ANALOG", {})}
    return c3d.read(write_c3d(path / "plate.c3d", BODY, values, FORCE_PLATFORM=described, **groups))


def check(plate: RawPlate, axes: np.ndarray = AXES, centre: tuple[float, float, float] = (0, 0, 0)) -> None:
    """The plate reads the force and moment of the free body, to single precision, in lab axes."""
    np.testing.assert_allclose(plate.force, FORCE @ axes.T, atol=1e-3)
    np.testing.assert_allclose(plate.moment, MOMENT @ axes.T, atol=1e-3)
    np.testing.assert_allclose(plate.origin, centre, atol=1e-6)


@pytest.mark.parametrize("kind", [1, 2, 3, 4])
def test_each_type_gives_the_wrench_of_the_free_body(tmp_path: Path, kind: int) -> None:
    """Types 1 to 4, each with its own channels, give the same force and moment about the surface's centre."""
    plate: dict[str, Any] = {"ORIGIN": np.array([[120.0], [200], [-40]])} if kind == 3 else {}
    values = sensors(kind)
    if kind == 4:
        matrix = np.diag([2.9, 2.9, 11.5, 2.2, 1.9, 0.95]) + np.random.default_rng(3).normal(0, 0.01, (6, 6))
        plate["CAL_MATRIX"], values = matrix[:, :, None], values @ np.linalg.inv(matrix).T
    units = ["N", "N", "N", "mm", "mm", "Nmm"] if kind == 1 else ["N"] * 8 if kind == 3 else ["V", "V", "V", "Nm", "Nm", "Nm"]
    raw = read(tmp_path, values, kind, plate, ANALOG={"UNITS": units})
    check(raw.plates[0])
    assert raw.plates[0].kind == f"type-{kind}"
    assert raw.plates[0].time[-1] == pytest.approx((N * PER_FRAME - 1) / 500)


@pytest.mark.parametrize("length", ["mm", "m"])
@pytest.mark.parametrize(("moment", "factor"), [("Nmm", 1e3), ("ntmm", 1e3), ("Nm", 1.0), ("N-M", 1.0), ("V", None)])
def test_units_of_points_and_moments_are_independent(tmp_path: Path, length: str, moment: str, factor: float | None) -> None:
    """N mm or N m, points in mm or m: the same wrench; a unit that says nothing is N times the unit of length."""
    per_metre = {"mm": 1e3, "m": 1.0}[length]
    values = sensors(2) * ([1, 1, 1] + [factor or per_metre] * 3)
    plate = {name: np.asarray(PLATE[name]) * per_metre / 1e3 for name in ("CORNERS", "ORIGIN")}
    units = ["N", "N", "N", moment, moment, moment]
    point = {"UNITS": length, "SCALE": -1.0}
    path = write_c3d(
        tmp_path / "a.c3d",
        BODY * per_metre / 1e3,
        values,
        FORCE_PLATFORM={"TYPE": np.array([2]), "CHANNEL": np.arange(1, 7)[:, None], **plate},
        ANALOG={"UNITS": units},
        POINT=point,
    )
    raw = c3d.read(path)
    check(raw.plates[0])
    np.testing.assert_allclose(raw.points, BODY / 1e3, atol=1e-6)  # metres, whatever the moments' unit


def test_moments_in_another_unit_than_stated_are_found_by_the_centre_of_pressure(tmp_path: Path) -> None:
    """'Nm' over values in N mm (met in a public file): the pressure fits the plate only in N mm, and a note says so."""
    plate = read(tmp_path, sensors(2) * [1, 1, 1, 1e3, 1e3, 1e3]).plates[0]
    check(plate)
    assert any("are in N mm" in note for note in plate.notes)


@pytest.mark.parametrize("kind", [2, 3])
def test_inverted_origin_is_turned_round_and_stated(tmp_path: Path, kind: int) -> None:
    """ORIGIN given from the surface to the sensors instead: same wrench, with a note."""
    origin = np.array([[120.0], [200], [40]]) if kind == 3 else np.array([[0.0], [0], [40]])
    plate = read(
        tmp_path,
        sensors(kind),
        kind,
        {"ORIGIN": origin},
        ANALOG={"UNITS": ["N", "N", "N"] + ["Nm"] * 3 if kind == 2 else ["N"] * 8},
    ).plates[0]
    check(plate)
    assert any("sign inverted" in note for note in plate.notes)


def test_plate_stands_anywhere_in_the_lab(tmp_path: Path) -> None:
    """Corners turned, tilted into a y-up lab and moved: the wrench turns with them and the origin is their mean."""
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    tilt = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    corners = tilt @ turn @ np.asarray(PLATE["CORNERS"])[:, :, 0] + np.array([[900.0], [0], [-300]])
    plate = read(tmp_path, sensors(2), plate={"CORNERS": corners[:, :, None]}).plates[0]
    check(plate, tilt @ turn @ AXES, (0.9, 0.0, -0.3))
    assert plate.corners is not None
    np.testing.assert_allclose(plate.corners.mean(0), plate.origin, atol=1e-6)


def test_unloaded_baseline_is_subtracted(tmp_path: Path) -> None:
    """Offsets seen on the frames that ZERO names, -27 to +80 N in real files, vanish from force and moment."""
    values = sensors(2) + np.array([3, -2, 80, 4, -5, 1])
    plate = read(tmp_path, values, plate={"ZERO": np.array([1, 3])}).plates[0]
    np.testing.assert_allclose(plate.force, FORCE @ AXES.T, atol=1e-3)
    assert any("subtracted as the baseline" in note for note in plate.notes)


@pytest.mark.parametrize("zero", [[0, 0], [1, 0], [31, 35]])
def test_no_baseline_and_a_loaded_baseline_are_left_alone(tmp_path: Path, zero: list[int]) -> None:
    """ZERO without frames, or over frames in which the person stands on the plate, changes nothing."""
    plate = read(tmp_path, sensors(2), plate={"ZERO": np.array(zero)}).plates[0]
    check(plate)
    assert not any("subtracted as the baseline" in note for note in plate.notes)
    assert any("a load, not subtracted" in note for note in plate.notes) == (zero == [31, 35])


@pytest.mark.parametrize(("form", "offset"), [("SIGNED", -100), ("UNSIGNED", -32700), ("UNSIGNED", 32700), ("SIGNED", 2047)])
def test_analog_offset_keeps_its_sign(tmp_path: Path, form: str, offset: int) -> None:
    """Counts are read as (count - OFFSET) SCALE GEN_SCALE, OFFSET as a signed or an unsigned 16-bit number."""
    zero = offset % 65536 if form == "UNSIGNED" else offset
    scale = np.array([0.1, 0.1, 0.5, 0.1, 0.1, 0.1])
    analog = {"SCALE": scale, "GEN_SCALE": 0.5, "OFFSET": np.full(6, offset), "FORMAT": form}
    plate = read(tmp_path, np.round(sensors(2) / (0.5 * scale)) + zero, ANALOG=analog).plates[0]
    np.testing.assert_allclose(plate.force, FORCE @ AXES.T, atol=0.13)


def test_stuck_channel_of_a_loaded_plate_is_named(tmp_path: Path) -> None:
    """A moment channel that never moves under a load is stuck; shear that always reads 0 was just not measured."""
    values = sensors(2)
    values[:, 4], values[:, 0] = 12.0, 0.0
    notes = read(tmp_path, values, ANALOG={"LABELS": ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]}).plates[0].notes
    assert "stuck: My" in notes
    assert "not measured (always 0): Fx" in notes


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"TYPE": np.array([2, 5])}, "type 5"),
        ({"CHANNEL": np.array([[1, 7], [2, 8], [3, 9], [4, 10], [5, 11], [6, 12]])}, "names channels"),
        ({"TYPE": np.array([2, 4])}, "CAL_MATRIX"),
        ({"CORNERS": np.stack([np.asarray(PLATE["CORNERS"])[:, :, 0], np.zeros((3, 4))], axis=2)}, "no area"),
    ],
)
def test_plate_that_forms_no_wrench_is_left_out_and_the_others_go_on(tmp_path: Path, change: dict, words: str) -> None:
    """A broken second plate is named with its fault; the first is read as ever."""
    both = {name: np.repeat(np.asarray(PLATE[name]), 2, axis=-1) for name in ("CORNERS", "ORIGIN")}
    both |= {"USED": 2, "TYPE": np.array([2, 2]), "CHANNEL": np.repeat(np.arange(1, 7)[:, None], 2, axis=1), **change}
    raw = read(tmp_path, sensors(2), plate=both)
    assert len(raw.plates) == 1
    check(raw.plates[0])
    assert any(note.startswith("plate 2 left out") and words in note for note in raw.notes)


def test_plate_that_does_not_record_is_left_out(tmp_path: Path) -> None:
    """A plate whose channels are all constant but not 0 measures nothing."""
    raw = read(tmp_path, np.ones((N * PER_FRAME, 1)) * [373.0, 374, 1447, 1, 1, 1])
    assert not raw.plates
    assert any("constant" in note for note in raw.notes)


def _sto(path: Path) -> np.ndarray:
    lines = path.read_text().split("endheader", 1)[1].splitlines()
    return np.array([[float(cell) for cell in line.split()] for line in lines[2:] if line.strip()])


def test_forces_and_pressure_equal_those_that_opensim_extracts(shared_data: Path) -> None:
    """walking2.c3d: forces to 1 N, moments to 0.01 N m, centre of pressure to 1 mm of the numbers OpenSim took from it."""
    folder = shared_data / "opensim"
    raw = c3d.read(folder / "walking2.c3d")
    plain, pressure = _sto(folder / "std_walking2_grfs.sto"), _sto(folder / "std_cop_walking2_grfs.sto")
    for number, plate in enumerate(raw.plates):
        rows = np.searchsorted(plate.time, plain[:, 0] - 1e-6)
        force, moment, first = plate.force[rows], plate.moment[rows], 1 + 9 * number
        np.testing.assert_allclose(force, plain[:, first : first + 3], atol=1.0)
        np.testing.assert_allclose(moment, plain[:, first + 6 : first + 9] / 1e3, atol=0.01)
        loaded = force[:, 2] > 20
        cop = plate.origin[:2] + np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:]
        np.testing.assert_allclose(cop[loaded], pressure[loaded, first + 3 : first + 5] / 1e3, atol=1e-3)
        assert loaded.sum() >= 10


def test_markers_equal_those_that_opensim_extracts(shared_data: Path) -> None:
    """walking2.c3d: every 10th frame of each marker equals OpenSim's TRC to its rounding of 0.1 mm, missing samples included."""
    folder = shared_data / "opensim"
    raw = c3d.read(folder / "walking2.c3d")
    lines = (folder / "std_walking2_markers.trc").read_text().splitlines()
    labels = lines[3].split()[2:]
    table = np.array([[float(cell) for cell in line.split()] for line in lines[6:] if line.strip()])
    theirs = table[:, 2:].reshape(len(table), -1, 3) / 1e3
    rows = np.round((table[:, 1] - raw.time[0]) * raw.rate).astype(int)
    order = [raw.labels.index(label) for label in labels]
    np.testing.assert_allclose(raw.points[rows][:, order], theirs, atol=6e-5)


@pytest.mark.parametrize("name", ["c3d_wholebody/PiG_Motion-FlatFoot-Full.c3d", "bmc/Gait.c3d", "nimble_odd/trial2.c3d"])
def test_forces_follow_those_of_the_libraries_helper(shared_data: Path, name: str) -> None:
    """Types 2 and 4: up to the baseline the force equals that of ezc3d's own plate helper."""
    raw = c3d.read(shared_data / name)
    for plate, theirs in zip(raw.plates, ezc3d.c3d(str(shared_data / name), extract_forceplat_data=True)["data"]["platform"], strict=True):
        difference = plate.force - theirs["force"].T
        np.testing.assert_allclose(difference, np.broadcast_to(difference[0], difference.shape), atol=1e-3)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("c3d_odd/sample28_type1.C3D", "type-1"),
        ("c3d_odd/sample02_pc_real.c3d", "type-2"),
        ("c3d_wholebody/FunctionalWalk.c3d", "type-2"),
        ("c3d_odd/sample_27_kyowadengyo.c3d", "type-3"),
        ("c3d_wholebody/Walking_Hybrid_1_1.c3d", "type-3"),
        ("bmc/Gait.c3d", "type-4"),
        ("c3d_wholebody/Walk1.c3d", "type-4"),
    ],
)
def test_pressure_lies_under_a_foot(shared_data: Path, name: str, kind: str) -> None:
    """Real gait on every plate type: while a plate carries 100 N its centre of pressure is within 0.1 m of a low marker."""
    raw = c3d.read(shared_data / name)
    for plate in raw.plates:
        assert plate.kind == kind
        assert np.quantile(_foot_distance(raw, plate), 0.95) < 0.1


def _foot_distance(raw: Raw, plate: RawPlate) -> np.ndarray:
    """Distance along the surface from the centre of pressure to the nearest marker within 0.25 m of it [m], loaded frames."""
    assert plate.corners is not None
    normal = np.cross(plate.corners[0] - plate.corners[2], plate.corners[1] - plate.corners[3])
    normal /= np.linalg.norm(normal)
    rows = np.searchsorted(plate.time, raw.time - 1e-9).clip(0, len(plate.time) - 1)
    load = plate.force[rows] @ normal
    loaded = np.abs(load) > 100
    cop = plate.origin + np.cross(normal, plate.moment[rows[loaded]]) / load[loaded, None]
    away, height = raw.points[loaded] - cop[:, None], np.abs((raw.points[loaded] - plate.origin) @ normal)
    along = away - (away @ normal)[..., None] * normal
    return np.min(np.where(height < 0.25, np.linalg.norm(along, axis=2), np.inf), axis=1)
