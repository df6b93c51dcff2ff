"""Recording: axes, signs, gaps, feet, mass, refusals and tables, on a person who stands on two plates and on public files."""

import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from plumbline import axes as lab
from plumbline import loads, tables
from plumbline.config import with_defaults
from plumbline.errors import PlumblineError, Refused
from plumbline.frames import fill
from plumbline.physics import G
from plumbline.readers.opensim import wrench
from plumbline.readers.raw import Array, Raw, RawPlate
from plumbline.recording import Recording, assemble, recordings, tables_of
from plumbline.study import Trial, find

MASS, W2, RATE, FORCE_RATE = 70.0, 10.0, 100.0, 500.0
STUDIES = Path(__file__).resolve().parents[1] / "studies"
Reader = Callable[[Path, Sequence[Mapping[str, Any]]], Raw]


def trial(task: str = "quiet", events: Path | None = None) -> Trial:
    """A trial of one file."""
    return Trial(f"sub-01_task-{task}", "sub-01", "", task, "", "01", (Path("a.c3d"),), events)


def sway(time: Array, axis: int) -> tuple[Array, Array]:
    """CoM and its acceleration, a few sines around 0.3 to 1.3 Hz [m, m/s2]."""
    x, a = np.zeros_like(time), np.zeros_like(time)
    for k, (f, size) in enumerate([(0.3, 0.01), (0.7, 0.004), (1.3, 0.002)]):
        w, phase = 2 * np.pi * (f + 0.05 * axis), k + axis
        x += size * np.sin(w * time + phase)
        a -= size * w**2 * np.sin(w * time + phase)
    return x, a


def person(seconds: float = 10.0, start: float = 0.0) -> Raw:
    """Somebody of 70 kg who stands on two plates and sways as x'' = w2 (x - p); pipeline axes.

    The left foot stands on plate 1 at x = -0.12 m and carries a share of the weight that moves with the CoP.
    """
    t, tf = (start + np.arange(int(seconds * r) + 1) / r for r in (RATE, FORCE_RATE))
    (x, ax), (y, ay) = sway(tf - start, 0), sway(tf - start, 1)
    p = np.column_stack([x - ax / W2, y - ay / W2])
    right = 0.5 + p[:, 0] / 0.24
    plates = []
    for side, share in ((-0.12, 1 - right), (0.12, right)):
        force = np.column_stack([MASS * ax * share, MASS * ay * share, MASS * G * share])
        arm = np.column_stack([np.zeros_like(tf), p[:, 1], np.zeros_like(tf)])
        corners = np.array([[side - 0.1, -0.3, 0], [side + 0.1, -0.3, 0], [side + 0.1, 0.3, 0], [side - 0.1, 0.3, 0]])
        plates.append(RawPlate(tf, force, np.cross(arm, force), np.array([side, 0.0, 0.0]), corners, "type-2"))
    body = np.column_stack([sway(t - start, 0)[0], sway(t - start, 1)[0], np.zeros_like(t)])
    places = {"LHEE": (-0.12, -0.08, 0.03), "RHEE": (0.12, -0.08, 0.03), "LTOE": (-0.13, 0.12, 0.03), "RTOE": (0.13, 0.12, 0.03)}
    places |= {"LASI": (-0.12, 0.1, 1.0), "RASI": (0.12, 0.1, 1.0), "HEAD": (0.0, 0.0, 1.7)}
    points = np.stack([np.array(v) + body * v[2] for v in places.values()], axis=1)
    return Raw(t, RATE, points, list(places), plates=plates)


def given_raw(raw: Raw) -> Reader:
    """A reader that returns `raw`."""
    return lambda file, columns: raw


def made(raw: Raw, task: str = "quiet", **options: Any) -> Recording:
    """The recording of `raw`."""
    return assemble(trial(task), read=given_raw(raw), **options)


def refused(raw: Raw, task: str = "quiet") -> Refused:
    """The refusal of `raw`."""
    with pytest.raises(Refused) as caught:
        made(raw, task)
    return caught.value


def in_lab(raw: Raw, matrix: Array) -> Raw:
    """The same recording in a lab whose axes are the columns of `matrix` (v_lab = v matrix)."""
    turn = [
        replace(p, force=p.force @ matrix, moment=p.moment @ matrix, origin=p.origin @ matrix, corners=p.corners @ matrix)
        for p in raw.plates
        if p.corners is not None
    ]
    return replace(raw, points=raw.points @ matrix, plates=turn)


def forces(raw: Raw, change: Callable[[Array], Array], moments: Callable[[Array], Array] = lambda m: m) -> Raw:
    """The same recording with forces and moments changed."""
    return replace(raw, plates=[replace(p, force=change(p.force), moment=moments(p.moment)) for p in raw.plates])


def rotations() -> list[Array]:
    """The 24 right-handed maps between axes."""
    signed = [np.diag(s) @ np.eye(3)[list(p)] for p in itertools.permutations(range(3)) for s in itertools.product((1.0, -1.0), repeat=3)]
    return [m for m in signed if np.linalg.det(m) > 0]


# -- axes -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("matrix", rotations(), ids=lambda m: lab.said(m.T))
def test_every_lab_gives_the_same_recording(matrix: Array) -> None:
    """Whatever the lab calls up and right, markers, forces and CoP come out alike, and `axes` says what was found."""
    plain, turned = made(person(4.0)), made(in_lab(person(4.0), matrix))
    assert turned.axes == lab.said(matrix)
    for label, values in plain.markers.items():
        np.testing.assert_allclose(turned.markers[label], values, atol=1e-12)
    for a, b in zip(plain.plates, turned.plates, strict=True):
        assert a.foot == b.foot
        np.testing.assert_allclose(b.force, a.force, atol=1e-9)
        np.testing.assert_allclose(b.cop, a.cop, atol=1e-9)
        np.testing.assert_allclose(b.free_moment, a.free_moment, atol=1e-9)


def test_config_overrides_what_is_found() -> None:
    """`axes:` of the config wins, and says so."""
    recording = made(person(4.0), axes={"x": "-X", "y": "-Y", "z": "+Z"})
    assert (recording.axes, recording.axes_from) == ("x=-X y=-Y z=+Z", "config")
    assert recording.markers["LHEE"][0, 0] > 0


@pytest.mark.parametrize("axes", [{"x": "+X", "y": "+Z", "z": "+Y"}, {"x": "X", "y": "X", "z": "Z"}])
def test_impossible_axes_stop_the_run(axes: dict[str, str]) -> None:
    """Left-handed axes and an axis named twice are errors of the study, not of one file."""
    with pytest.raises(PlumblineError) as caught:
        made(person(4.0), axes=axes)
    assert not isinstance(caught.value, Refused)


@pytest.mark.parametrize(
    ("left", "right"),
    [("LHEE", "RHEE"), ("L.Heel", "R.Heel"), ("L_5meta", "R_5meta"), ("L_toe", "r_toe"), ("left_heel", "right_heel"),
     ("calcn_l", "calcn_r"), ("Heel.L", "Heel.R"), ("footL", "footR"), ("Anna:LTOE", "Anna:RTOE"), ("l heel", "r heel"),
     ("lASIS", "rASIS"), ("LeftFoot", "RightFoot"), ("L.MT5", "R.MT5"), ("Toe_L1", "Toe_R1")],
)  # fmt: skip
def test_naming_styles_of_left_and_right(left: str, right: str) -> None:
    """A left marker and its right twin are found in all common naming styles."""
    assert lab.pairs(["C7", right, left, "STRN"]) == [(2, 1)]


def test_unlike_labels_are_no_pair() -> None:
    """Labels that merely begin with L or R make no pair."""
    assert lab.pairs(["L5", "RIB", "LUMBAR", "STRN", "C7"]) == []


def test_standing_askew_is_noted() -> None:
    """A subject turned by 35 degrees gets the nearest lab axis, and a note with the angle."""
    c, s = np.cos(np.radians(35)), np.sin(np.radians(35))
    recording = made(in_lab(person(4.0), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])))
    assert recording.axes == "x=+X y=+Y z=+Z"
    assert any("35 degrees" in n for n in recording.notes)


def test_without_feet_two_plates_show_the_line() -> None:
    """No markers: the line between two plates is lateral, its sign and the way up are assumed, and notes say so."""
    raw = person(4.0)
    recording = made(replace(raw, points=raw.points[:, :0], labels=[], time=np.empty(0)))
    assert recording.axes == "x=+X y=+Y z=+Z"
    assert "assumed" in recording.axes_from
    assert recording.rate == pytest.approx(FORCE_RATE)
    assert recording.time.size == raw.plates[0].time.size


# -- forces -----------------------------------------------------------------------------------------------------------


def test_net_force_and_cop_are_what_was_made() -> None:
    """The recorded wrench gives back shear, weight and CoP; mass is the weight over G."""
    recording = made(person())
    assert recording.mass == pytest.approx(MASS, rel=1e-3)
    assert [p.foot for p in recording.plates] == ["left", "right"]
    tf = recording.plates[0].time
    y, ay = sway(tf, 1)
    for plate in recording.plates:
        np.testing.assert_allclose(plate.cop[:, 1], y - ay / W2, atol=1e-12)
        np.testing.assert_allclose(plate.free_moment, 0.0, atol=1e-9)
    np.testing.assert_allclose(sum(p.force[:, 0] for p in recording.plates), MASS * sway(tf, 0)[1], atol=1e-9)


@pytest.mark.parametrize("vertical", [1.0, -1.0])
@pytest.mark.parametrize("shear", [1.0, -1.0])
def test_signs_are_found_from_physics(vertical: float, shear: float) -> None:
    """Action or reaction is told from the weight, the shear's sign from CoP against shear; all four files give one recording."""
    plain = made(person())
    change = np.array([vertical * shear, vertical * shear, vertical])
    odd = made(forces(person(), lambda f: f * change, lambda m: m * vertical))
    assert (odd.force_sign, odd.shear_sign) == (vertical, shear)
    for a, b in zip(plain.plates, odd.plates, strict=True):
        np.testing.assert_allclose(b.force, a.force, atol=1e-9)
        np.testing.assert_allclose(b.cop, a.cop, atol=1e-9)


def test_plates_of_opposite_sign_in_one_file() -> None:
    """One plate pushes up and one down in the file: each is turned by its own weight, and the notes say so."""
    raw = person()
    raw.plates[1] = replace(raw.plates[1], force=-raw.plates[1].force, moment=-raw.plates[1].moment)
    recording = made(raw)
    assert np.isnan(recording.force_sign)
    assert all((p.force[:, 2] > 0).all() for p in recording.plates)
    assert recording.mass == pytest.approx(MASS, rel=1e-3)
    assert any("differ in the sign" in n for n in recording.notes)


def test_offsets_of_idle_plates_do_not_count() -> None:
    """An unloaded plate that reads -27 or +48 N is left out by name and touches neither sign nor mass."""
    raw = person()
    for offset in (-27.0, 48.0):
        idle = replace(raw.plates[0], force=np.tile([0.0, 0.0, offset], (raw.plates[0].time.size, 1)) + 1e-3 * raw.plates[0].force)
        recording = made(replace(raw, plates=[idle, *raw.plates]))
        assert [p.number for p in recording.plates] == [2, 3]
        assert recording.force_sign == 1.0
        assert recording.mass == pytest.approx(MASS, rel=1e-3)
        assert any("plate 1" in n and "without a load" in n for n in recording.notes)


def test_cop_is_missing_while_a_plate_is_light() -> None:
    """Below 20 N a CoP means nothing: it is NaN there and nowhere else."""
    raw = person()
    lift = (raw.plates[0].time > 4) & (raw.plates[0].time < 6)
    raw.plates[0].force[lift], raw.plates[0].moment[lift] = 3.0, 0.5
    np.testing.assert_array_equal(np.isnan(made(raw).plates[0].cop[:, 0]), lift)


def test_the_wrench_is_kept_however_light_the_load() -> None:
    """The moment about the coordinates' origin is the recorded wrench in every sample, 3 N included."""
    raw = person()
    lift = (raw.plates[0].time > 4) & (raw.plates[0].time < 6)
    raw.plates[0].force[lift], raw.plates[0].moment[lift] = 3.0, 0.5
    for plate, got in zip(raw.plates, made(raw).plates, strict=True):
        np.testing.assert_allclose(got.moment, plate.moment + np.cross(plate.origin, plate.force), atol=1e-9)


def test_the_wrench_of_a_plate_without_corners_is_that_of_its_cop() -> None:
    """With force and CoP alone the moment is CoP x force; without a CoP a load has no moment, and a light load is at the plate."""
    force = np.tile([3.0, -4.0, 500.0], (2000, 1)) + np.random.default_rng(2).normal(size=(2000, 3))
    force[50:60, 2] = 5.0
    cop = np.tile([0.1, 0.2, 0.0], (2000, 1))
    cop[40:60] = np.nan
    origin, moment = wrench(force, cop, np.zeros_like(force))
    plate, _ = loads.reaction(1, RawPlate(np.arange(2000) / 500, force, moment, origin, None, "text"), np.eye(3))
    np.testing.assert_allclose(plate.moment[60:], np.cross(cop[60:], force[60:]))
    assert np.isnan(plate.moment[40:50]).all()
    np.testing.assert_allclose(plate.moment[50:60], np.cross(origin, force[50:60]))


def test_turning_the_shear_leaves_the_cop() -> None:
    """On a plate 0.3 m above the origin the shear, and with it the free moment, changes its sign and the CoP does not move."""
    rng = np.random.default_rng(4)
    force = rng.normal(size=(50, 3)) + np.array([0.0, 0.0, 500.0])
    raw = RawPlate(np.arange(50) / 100, force, rng.normal(size=(50, 3)), np.array([0.1, 0.2, 0.3]), None, "type-2")
    plate, _ = loads.reaction(1, raw, np.eye(3))
    loads.turn_shear(plate)
    cop, free = loads.centre(plate.force, plate.moment, np.zeros(3), 0.3)
    np.testing.assert_allclose(plate.force, force * [-1, -1, 1])
    np.testing.assert_allclose(cop, plate.cop)
    np.testing.assert_allclose(free, plate.free_moment)


def test_a_cop_no_foot_can_reach_is_dropped() -> None:
    """A CoP half a metre from the foot on that plate is set missing, counted in the notes."""
    raw = person()
    far = slice(1000, 1100)
    raw.plates[0] = replace(raw.plates[0], foot="left")
    raw.plates[0].moment[far, 0] += 0.9 * raw.plates[0].force[far, 2]
    recording = made(raw)
    assert np.isnan(recording.plates[0].cop[far]).all()
    assert np.isnan(recording.plates[0].moment[far]).all()
    assert np.isfinite(recording.plates[0].cop[:1000]).all()
    assert np.isfinite(recording.plates[0].moment[:1000]).all()
    assert any("100 of" in n for n in recording.notes)


def test_both_feet_on_one_plate_belong_to_neither() -> None:
    """One plate under both feet carries no single foot."""
    raw = person()
    left, right = raw.plates
    origin = np.zeros(3)
    moment = sum(p.moment + np.cross(p.origin - origin, p.force) for p in (left, right))
    noise = np.random.default_rng(1).normal(scale=1e-3, size=left.force.shape) * [0, 0, 1]
    one = replace(left, force=left.force + right.force + noise, moment=np.asarray(moment), origin=origin, corners=None)
    recording = made(replace(raw, plates=[one]))
    assert recording.plates[0].foot == ""
    tf = one.time
    x, ax = sway(tf, 0)
    np.testing.assert_allclose(recording.plates[0].cop[:, 0], x - ax / W2, atol=1e-6)


def test_zero_shear_is_no_shear() -> None:
    """Shear columns of zeros are taken as not recorded: NaN, and no claim on their sign."""
    recording = made(forces(person(), lambda f: f * [0.0, 0.0, 1.0]))
    assert np.isnan(recording.plates[0].force[:, :2]).all()
    assert np.isnan(recording.shear_sign)
    assert recording.mass == pytest.approx(MASS, rel=1e-3)


def test_mass_holds_in_squats_and_falls() -> None:
    """Mean force over G plus the markers' mean acceleration is the mass in squats and where the trial ends in a fall."""
    raw = person()
    t, tf = raw.time, raw.plates[0].time
    for height, force in (
        (lambda s: 0.1 * np.cos(2 * np.pi * 0.4 * s), lambda s: -0.1 * (2 * np.pi * 0.4) ** 2 * np.cos(2 * np.pi * 0.4 * s)),
        (lambda s: -0.5 * np.clip(s - 9, 0, 1) ** 3, lambda s: -3.0 * np.clip(s - 9, 0, 1)),
    ):
        moved = replace(raw, points=raw.points + np.column_stack([0 * t, 0 * t, height(t)])[:, None])
        moved.plates = [replace(p, force=p.force * [1, 1, 1] + np.column_stack([0 * tf, 0 * tf, MASS * force(tf) / 2])) for p in raw.plates]
        assert made(moved).mass == pytest.approx(MASS, rel=3e-3)


def test_no_mass_from_gait() -> None:
    """Steps on two plates one after the other give no mass, and the shear keeps the vertical force's sign."""
    raw = person()
    tf = raw.plates[0].time
    for plate, (a, b) in zip(raw.plates, ((2, 4), (4, 6)), strict=True):
        off = (tf < a) | (tf > b)
        plate.force[off] = plate.moment[off] = 0.0
    recording = made(raw)
    assert np.isnan(recording.mass)
    assert recording.shear_sign == 1.0


# -- frames -----------------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(length=st.integers(1, 30), at=st.integers(1, 60), longest=st.integers(0, 20))
def test_gaps_are_filled_up_to_the_stated_length(length: int, at: int, longest: int) -> None:
    """A gap of k frames is filled exactly if k/rate <= max_gap and it has both ends; each filled sample is flagged, no other is touched."""
    t = np.arange(100) / RATE
    points = np.stack([np.sin(t), np.cos(t), t], axis=1)[:, None]
    holed = points.copy()
    holed[at : at + length] = np.nan
    out = fill(holed, RATE, longest / RATE)
    gone = slice(at, at + length)
    assert out.filled[gone].all() == (length <= longest)
    assert out.filled.sum() == (length if length <= longest else 0)
    np.testing.assert_allclose(
        out.points[gone] if length <= longest else points[:0], points[gone] if length <= longest else points[:0], atol=2e-3
    )
    np.testing.assert_array_equal(out.points[~out.filled[:, 0]], holed[~out.filled[:, 0]])


def test_gaps_at_the_ends_stay() -> None:
    """Nothing is extrapolated."""
    raw = person(4.0)
    raw.points[:3, 0] = raw.points[-3:, 0] = np.nan
    recording = made(raw, max_gap=1.0)
    assert not recording.filled["LHEE"].any()
    assert np.isnan(recording.markers["LHEE"][[0, 1, 2, -1, -2, -3]]).all()


def test_uneven_time_becomes_even() -> None:
    """A robot's 15 to 25 ms clock becomes an even one at the median rate, true within 0.1 mm, with a note; an even clock is left alone."""
    rng = np.random.default_rng(3)
    time = np.cumsum(rng.uniform(0.015, 0.025, 400))
    points = np.stack([0.05 * np.sin(2 * np.pi * 0.5 * time), 0 * time, 1 + 0 * time], axis=1)[:, None]
    raw = Raw(time, 50.0, points, ["HEAD"])
    recording = made(raw, "static")
    steps = np.diff(recording.time)
    np.testing.assert_allclose(steps, 1 / 50.0, rtol=1e-9)
    np.testing.assert_allclose(recording.markers["HEAD"][:, 0], 0.05 * np.sin(2 * np.pi * 0.5 * recording.time), atol=1e-4)
    assert any("uneven time" in n for n in recording.notes)
    even = made(person(4.0))
    np.testing.assert_array_equal(even.time, person(4.0).time)


def test_a_hole_in_the_clock_is_a_gap() -> None:
    """Frames dropped for 0.5 s are missing, not invented; a hole of three frames is filled and flagged."""
    time = np.delete(np.arange(400) / RATE, np.r_[100:103, 200:250])
    points = np.stack([np.sin(time), 0 * time, 1 + 0 * time], axis=1)[:, None]
    recording = made(Raw(time, RATE, points, ["HEAD"]), "static")
    x, filled = recording.markers["HEAD"][:, 0], recording.filled["HEAD"]
    assert recording.time.size == 400
    assert np.isnan(x[200:250]).all()
    assert filled[100:103].all()
    assert filled.sum() == 3


def test_first_time_need_not_be_zero() -> None:
    """A recording whose clock starts at 4.9 s keeps it."""
    recording = made(person(4.0, start=4.9))
    assert recording.time[0] == pytest.approx(4.9)
    assert recording.plates[0].time[0] == pytest.approx(4.9)


def test_two_files_are_one_trial() -> None:
    """Markers of one file and forces of another give the recording that one file with both gives."""
    whole = person(4.0)
    parts = {"m.trc": replace(whole, plates=[]), "f.mot": Raw(np.empty(0), FORCE_RATE, np.empty((0, 0, 3)), [], plates=whole.plates)}
    pair = replace(trial(), files=(Path("f.mot"), Path("m.trc")))
    one, two = made(whole), assemble(pair, read=lambda file, columns: parts[file.name])
    np.testing.assert_array_equal(one.markers["HEAD"], two.markers["HEAD"])
    np.testing.assert_array_equal(one.plates[1].cop, two.plates[1].cop)
    late = {**parts, "f.mot": person(4.0, start=60.0)}
    late["f.mot"] = replace(late["f.mot"], time=np.empty(0), points=np.empty((0, 0, 3)), labels=[])
    with pytest.raises(Refused) as caught:
        assemble(pair, read=lambda file, columns: late[file.name])
    assert caught.value.reason == "bad_time"


def test_a_mirrored_person_gives_mirrored_numbers() -> None:
    """Mirrored at the sagittal plane with labels swapped: every lateral number changes its sign and nothing else changes."""
    raw = person(4.0)
    mirror = np.array([-1.0, 1.0, 1.0])
    swapped = [{"L": "R", "R": "L"}.get(label[0], label[0]) + label[1:] for label in raw.labels]
    turned = [replace(p, force=p.force * mirror, moment=-p.moment * mirror, origin=p.origin * mirror, corners=None) for p in raw.plates]
    one = made(replace(raw, plates=[replace(p, corners=None) for p in raw.plates]))
    two = made(replace(raw, points=raw.points * mirror, labels=swapped, plates=turned))
    assert one.axes == two.axes
    np.testing.assert_allclose(two.markers["RHEE"], one.markers["LHEE"] * mirror, atol=1e-12)
    for a, b in zip(one.plates, two.plates, strict=True):
        assert {a.foot, b.foot} == {"left", "right"}
        np.testing.assert_allclose(b.cop, a.cop * mirror, atol=1e-9)
        np.testing.assert_allclose(b.force, a.force * mirror, atol=1e-9)


# -- refusals ---------------------------------------------------------------------------------------------------------


def test_what_cannot_be_used_is_refused_with_its_reason() -> None:
    """No data, no plates, nobody on them, a dead channel, a short trial: each has its own code."""
    raw = person()
    dead = person()
    dead.plates[0].force[:, 1] = 12.5
    assert refused(Raw(raw.time, RATE, np.full_like(raw.points, np.nan), raw.labels)).reason == "no_data"
    assert refused(replace(raw, plates=[])).reason == "no_plates"
    assert refused(forces(raw, lambda f: 0.02 * f)).reason == "unloaded"
    assert refused(dead).reason == "stuck_channel"
    assert "force y = 12.5 N" in refused(dead).message
    assert refused(replace(raw, plates=[replace(raw.plates[0], notes=["stuck: FZ3"]), raw.plates[1]])).message.endswith("FZ3")
    assert refused(person(0.9)).reason == "too_short"


def test_what_each_task_needs() -> None:
    """Gait of 1.3 s passes; a static pose needs 0.2 s and no plates; on empty plates nobody has to stand."""
    assert made(person(1.3), "walk").plates
    assert made(person(0.3), "static").plates
    assert not made(replace(person(), plates=[]), "static").plates
    empty = made(forces(person(), lambda f: 0.02 * f, lambda m: 0.02 * m), "empty")
    assert len(empty.plates) == 2
    assert np.isnan(empty.plates[0].cop).all()


def test_a_reader_that_breaks_refuses_the_file_only() -> None:
    """Whatever a reader raises makes its file unreadable, with the text; an error of the study itself still stops the run."""

    def broken(file: Path, columns: Any) -> Raw:
        raise ZeroDivisionError("somewhere deep")

    def study_error(file: Path, columns: Any) -> Raw:
        raise PlumblineError("axes")

    rows, markers, _ = tables_of([trial()], read=broken)
    assert rows.loc[0, "reason"] == "unreadable"
    assert "somewhere deep" in rows.loc[0, "message"]
    assert markers.empty
    with pytest.raises(PlumblineError, match="axes"):
        tables_of([trial()], read=study_error)


# -- events -----------------------------------------------------------------------------------------------------------


def events(tmp_path: Path, content: str, start: float = 0.0) -> Recording:
    """A recording with an events file."""
    file = tmp_path / "x_events.tsv"
    file.write_text(content, encoding="utf-8")
    return assemble(trial(events=file), read=given_raw(person(start=start)))


def test_events_count_from_the_first_sample(tmp_path: Path) -> None:
    """As in BIDS; in the recording they stand in the file's own time."""
    got = events(tmp_path, "onset\tduration\ttrial_type\n5.0\t0.25\tpush\n1.0\tn/a\trelease\n", start=4.0)
    assert got.events == [(5.0, 0.0, "release"), (9.0, 0.25, "push")]


def test_odd_events_are_noted(tmp_path: Path) -> None:
    """An event after the end and a type without a meaning are kept, and named in the notes."""
    got = events(tmp_path, "onset\tduration\ttrial_type\n99\t0\tpush\n1\t0\tsneeze\n")
    assert any("99" in n for n in got.notes)
    assert any("sneeze" in n for n in got.notes)


@pytest.mark.parametrize(
    "content", ["", "onset,duration\n1,2\n", "onset\tduration\ttrial_type\none\t0\tpush\n", "onset\tduration\ttrial_type\n1\t-1\tpush\n"]
)
def test_bad_events(tmp_path: Path, content: str) -> None:
    """An events file that cannot be read refuses its trial, naming the file."""
    with pytest.raises(Refused, match=r"x_events\.tsv") as caught:
        events(tmp_path, content)
    assert caught.value.reason == "bad_events"


# -- tables -----------------------------------------------------------------------------------------------------------


def test_tables_hold_the_whole_recording(tmp_path: Path) -> None:
    """Written to parquet and read back, a recording is the same, gaps, corners, notes and signs included."""
    raw = person()
    raw.points[100:105, 0] = np.nan
    raw.derived["CentreOfMass"] = raw.points[:, -1].copy()
    other = replace(trial("walk"), trial="sub-02_task-walk", subject="sub-02")
    made_tables = tables_of([trial(), other], read=given_raw(raw), raw=Path("/nowhere"))
    for name, table in zip(("trials", "markers", "plates"), made_tables, strict=True):
        tables.write(name, table, tmp_path / f"{name}.parquet")
    stored = tables.read("trials", tmp_path / "trials.parquet")
    back = list(recordings(stored, lambda name, trial: tables.read(name, tmp_path / f"{name}.parquet", trial=trial)))
    assert [r.trial.subject for r in back] == ["sub-01", "sub-02"]
    want, got = made(raw), back[0]
    assert (got.rate, got.mass, got.axes, got.axes_from, got.notes) == (want.rate, want.mass, want.axes, want.axes_from, want.notes)
    assert (got.force_sign, got.shear_sign, got.force_rate) == (want.force_sign, want.shear_sign, want.force_rate)
    np.testing.assert_array_equal(got.time, want.time)
    assert list(got.markers) == list(want.markers)
    for label in want.markers:
        np.testing.assert_array_equal(got.markers[label], want.markers[label])
        np.testing.assert_array_equal(got.filled[label], want.filled[label])
    np.testing.assert_array_equal(got.derived["CentreOfMass"], want.derived["CentreOfMass"])
    for a, b in zip(want.plates, got.plates, strict=True):
        assert (a.number, a.foot) == (b.number, b.foot)
        for field in ("time", "force", "moment", "cop", "free_moment", "corners"):
            np.testing.assert_array_equal(getattr(a, field), getattr(b, field))


def test_a_refused_trial_is_a_row() -> None:
    """Among good trials a refused one keeps its row with reason, message and hint, and has no samples."""
    raw = {"sub-01_task-quiet": person(4.0), "sub-01_task-walk": person(0.5)}
    pair = [replace(trial(task), files=(Path(f"sub-01_task-{task}.c3d"),)) for task in ("quiet", "walk")]
    rows, markers, plates = tables_of(pair, read=lambda file, columns: raw[file.stem])
    assert list(rows["reason"]) == ["", "too_short"]
    assert rows.loc[1, "hint"]
    assert set(markers["trial"]) == set(plates["trial"]) == {"sub-01_task-quiet"}
    assert json.loads(rows.loc[0, "notes"])
    assert len(markers) == 401 * 7  # seven markers


def test_nothing_at_all_still_makes_tables() -> None:
    """No trial, or none that can be used: empty tables with all their columns."""
    for name, table in zip(("trials", "markers", "plates"), tables_of([]), strict=True):
        assert list(table.columns) == [c.name for c in tables.TABLES[name]]


# -- public recordings ------------------------------------------------------------------------------------------------


def study(name: str, shared_data: Path) -> dict[str, Recording]:
    """All recordings of a committed study that are not refused, by their files."""
    config = with_defaults(yaml.safe_load((STUDIES / name / "config.yaml").read_text(encoding="utf-8")))
    got = tables_of(find(STUDIES / name, str(shared_data / name)).trials, columns=config["columns"], axes=config["axes"])
    used = got[0][got[0]["reason"] == ""]
    made_tables = {"markers": got[1], "plates": got[2]}

    def rows_of(name: str, trial: str) -> pd.DataFrame:
        return made_tables[name][made_tables[name]["trial"] == trial]

    return dict(zip(used["files"], recordings(got[0], rows_of), strict=True))


def test_the_same_authors_with_opposite_shear(shared_data: Path) -> None:
    """bds records the shear with the other sign, pds does not; physics tells in every trial, and body mass is the stated one within 6 %."""
    for name, sign, masses in (("bds", -1.0, {"sub-01": 54.2, "sub-09": 66.0, "sub-14": 69.1}), ("pds", 1.0, {"sub-13": 65.35})):
        for recording in study(name, shared_data).values():
            if recording.plates:
                assert recording.shear_sign == sign
                assert recording.mass == pytest.approx(masses[recording.trial.subject], rel=0.06)


def test_pds_knows_its_sides_and_bds_its_axes(shared_data: Path) -> None:
    """pds: y up, z to the right, from the feet its columns name; bds: from its config."""
    assert {r.axes for r in study("pds", shared_data).values()} == {"x=+Z y=+X z=+Y"}
    assert {r.axes_from for r in study("bds", shared_data).values()} == {"config"}


def test_nimble_subject_weighs_60_kg_in_each_standing_trial(shared_data: Path) -> None:
    """Static pose and squats agree on 60.0 kg within 0.3 %; both plates know their foot in all six trials."""
    got = study("nimble_subject4", shared_data)
    assert len(got) == 6
    for recording in got.values():
        assert recording.axes == "x=+Z y=+X z=+Y"
        assert {p.foot for p in recording.plates} == {"left", "right"}
        if recording.trial.task in ("static", "squats"):
            assert recording.mass == pytest.approx(60.03, rel=3e-3)


def test_leaning_at_the_assumed_rate(shared_data: Path) -> None:
    """fbos: 76.9 kg in all three trials, CoP of each plate within the foot on it."""
    for recording in study("fbos", shared_data).values():
        assert recording.mass == pytest.approx(76.9, abs=0.1)
        assert [p.foot for p in recording.plates] == ["left", "right"]
        assert not any("set missing" in n for n in recording.notes)


def test_treadmill_file_with_a_broken_belt(shared_data: Path) -> None:
    """moore2013_walk: the right belt's CoP is not under the right foot; that is said and those samples are missing."""
    (recording,) = study("moore2013_walk", shared_data).values()
    left, right = recording.plates
    assert np.isfinite(left.cop[:, 0]).mean() > 0.6
    assert np.isfinite(right.cop[:, 0]).mean() < 0.1
    assert any("plate 2" in n and "set missing" in n for n in recording.notes)


def test_whole_body_c3d(shared_data: Path) -> None:
    """c3d_wholebody: nine of ten files are read; weights are the stated ones, vertical is up in all."""
    got = study("c3d_wholebody", shared_data)
    assert len(got) == 9
    assert "Standing_Hybrid_2.c3d" not in got  # nobody stands on the plates
    assert got["FunctionalStatic.c3d"].mass == pytest.approx(60, rel=0.02)
    assert got["PiG_Calibration-FlatFoot-Full.c3d"].mass == pytest.approx(47.5, rel=0.04)
    assert all(r.axes.endswith("z=+Z") for r in got.values())
    assert [p.foot for p in got["FunctionalWalk.c3d"].plates] == ["right", "left", "left"]
    assert got["Capture0008_Standing.c3d"].mass == pytest.approx(37.8, abs=0.2)  # a child who gets on the plates meanwhile


def test_opposite_plates_in_one_public_file(shared_data: Path) -> None:
    """JH_01.c3d: -713 N and +380 N become +713 N and +380 N."""
    item = replace(trial(), files=(shared_data / "nimble_odd" / "JH_01.c3d",))
    loads = [float(np.mean(p.force[:, 2])) for p in assemble(item).plates]
    np.testing.assert_allclose(loads, [713.1, 380.1], atol=0.5)
