"""Signals of one recording: CoM, angular momentum, forces at the frames' times, support, what is said of a poor recording."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from plumbline import body, com_force, forces, tables
from plumbline.markerset import MarkerSet, load, match, named, parse
from plumbline.physics import G
from plumbline.signals import Signals, of_part, signals
from plumbline.study import Participant, Trial

Array = NDArray[np.float64]
TRIAL = Trial("sub-01_task-quiet_run-01", "sub-01", "", "quiet", "", "01", ())
SOMEBODY = Participant("sub-01", 70.0, 1.75, "M")
XYZ = ("x", "y", "z")


@dataclass
class Plate:
    time: Array
    force: Array
    cop: Array
    free_moment: Array
    corners: Array | None = None
    foot: str = ""


@dataclass
class Recording:
    time: Array
    rate: float
    markers: dict[str, Array] = field(default_factory=dict)
    filled: dict[str, Any] = field(default_factory=dict)
    derived: dict[str, Array] = field(default_factory=dict)
    plates: list[Plate] = field(default_factory=list)
    mass: float = float("nan")
    trial: Trial = TRIAL


def rod_set(**support: Any) -> MarkerSet:
    """A body of one rod from A to B."""
    rod = {"proximal": ["A"], "distal": ["B"], "mass": 1.0, "com": 0.4, "gyration": 0.3}
    return parse({"segments": {"rod": rod}, **({"support": support} if support else {})}, "rod.yaml", "rod")


def columns(frame: pd.DataFrame, name: str) -> Array:
    return frame[[f"{name}_{a}" for a in XYZ]].to_numpy(float)


def run(recording: Recording, markerset: MarkerSet | None, who: Participant = SOMEBODY, cutoff: float = 2.0) -> Signals:
    return signals(recording, who, markerset, cutoff=cutoff)


# -- the body ---------------------------------------------------------------------------------------------------------


def turning_rod(axis: str, rate: float = 200.0) -> tuple[Array, Array, Array]:
    """A rod of 0.8 m that turns at 2 rad/s about an axis through its CoM while that flies off at 1.5 m/s."""
    t = np.arange(200) / rate
    c, s = np.cos(2.0 * t), np.sin(2.0 * t)
    u = {"y": np.column_stack([s, 0 * t, c]), "x": np.column_stack([0 * t, -s, c]), "z": np.column_stack([c, s, 0 * t])}[axis]
    com = np.column_stack([1.5 * t, 0.3 + 0 * t, 1.0 + 0.5 * t])
    return t, com - 0.4 * 0.8 * u, com + 0.6 * 0.8 * u


@pytest.mark.parametrize("axis", XYZ)
def test_a_turning_rod_has_its_angular_momentum(axis: str) -> None:
    """A flying rod's angular momentum about its CoM is m (0.3 l)^2 Omega about the axis of its turn, right-handed, and nothing else."""
    t, a, b = turning_rod(axis)
    frame = body.build({"A": a, "B": b}, rod_set(), "M")
    momentum = frame.angular_momentum(t, 70.0)[2:-2]
    expected = np.zeros(3)
    expected[XYZ.index(axis)] = 70.0 * (0.3 * 0.8) ** 2 * 2.0
    np.testing.assert_allclose(momentum, np.broadcast_to(expected, momentum.shape), atol=2e-4)


def two_rods(n: int = 300, seed: int = 3) -> tuple[Array, dict[str, Array]]:
    """Two rods that tumble smoothly."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    markers = {}
    for name in "ABCD":
        w, phase, size = rng.uniform(1, 4, (3, 1)), rng.uniform(0, 6, (3, 1)), rng.uniform(0.1, 0.4, (3, 1))
        markers[name] = (rng.uniform(-1, 1, (3, 1)) + size * np.sin(w * t + phase)).T
    return t, markers


def two_set() -> MarkerSet:
    return parse(
        {
            "segments": {
                "one": {"proximal": ["A"], "distal": ["B"], "mass": 0.6, "com": 0.4, "gyration": 0.3},
                "two": {"proximal": ["C"], "distal": ["D"], "mass": 0.4, "com": 0.5, "gyration": 0.25},
            }
        },
        "two.yaml",
        "two",
    )


def test_two_point_masses_swing_about_their_centre() -> None:
    """L of segments without size is the textbook sum over r x m v, and the CoM their weighted mean."""
    t, m = two_rods()
    small = parse(
        {
            "segments": {
                "one": {"proximal": ["A"], "distal": ["B"], "mass": 0.6, "com": 0.0, "gyration": 0.0},
                "two": {"proximal": ["C"], "distal": ["D"], "mass": 0.4, "com": 0.0, "gyration": 0.0},
            }
        },
        "two.yaml",
        "two",
    )
    frame = body.build(m, small, "M")
    np.testing.assert_allclose(frame.com(), 0.6 * m["A"] + 0.4 * m["C"])
    apart = m["A"] - m["C"]
    expected = 70.0 * 0.24 * np.cross(apart, np.gradient(apart, t, axis=0))  # reduced mass m1 m2 / (m1 + m2)
    np.testing.assert_allclose(frame.angular_momentum(t, 70.0), expected, atol=1e-10)


def test_angular_momentum_knows_no_place_and_turns_with_the_body() -> None:
    """L does not change when everything is moved or flies evenly, and turns with everything about the vertical; so does the CoM."""
    t, m = two_rods()
    base = body.build(m, two_set(), "M")
    shift = np.array([30.0, -20.0, 5.0]) + t[:, None] * np.array([1.0, 2.0, 0.0])
    moved = body.build({k: v + shift for k, v in m.items()}, two_set(), "M")
    np.testing.assert_allclose(moved.angular_momentum(t, 70.0), base.angular_momentum(t, 70.0), atol=1e-9)
    np.testing.assert_allclose(moved.com(), base.com() + shift)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    turned = body.build({k: v @ turn.T for k, v in m.items()}, two_set(), "M")
    np.testing.assert_allclose(turned.angular_momentum(t, 70.0), base.angular_momentum(t, 70.0) @ turn.T, atol=1e-9)


def test_the_sagittal_radius_is_used_about_the_forward_axis() -> None:
    """A standing thigh that falls sideways turns with its sagittal radius, one that falls forwards with its transverse one."""
    mine = parse(
        {
            "segments": {
                "thigh": {"proximal": ["RHIP"], "distal": ["RKNE"], "table": "de-leva-1996/thigh"},
                "rest": {"proximal": ["P"], "distal": ["Q"], "mass": 0.8, "com": 0.0, "gyration": 0.0},
            }
        },
        "x.yaml",
        "x",
    )
    t = np.arange(21) / 1000.0
    middle = 10
    angle = 1.0 * (t - t[middle])
    still = np.zeros((21, 3))
    for tilt, axis, radius in (((1, 0), 1, 0.369), ((0, 1), 0, 0.364)):
        u = np.column_stack([tilt[0] * np.sin(angle), tilt[1] * np.sin(angle), np.cos(angle)])
        markers = {"RHIP": 0.3612 * 0.4 * u, "RKNE": -0.6388 * 0.4 * u, "P": still, "Q": still + 1.0}
        got = body.build(markers, mine, "F").angular_momentum(t, 100.0)[middle]
        assert abs(got[axis]) == pytest.approx(100.0 * 0.1478 * (radius * 0.4) ** 2, rel=1e-4)


def test_a_segment_lost_for_some_frames_makes_no_jump() -> None:
    """A light segment unseen for 30 frames leaves a CoM within 2 mm of the truth, without a step, and the frames are flagged."""
    _, m = two_rods()
    light = parse(
        {
            "segments": {
                "one": {"proximal": ["A"], "distal": ["B"], "mass": 0.95, "com": 0.4, "gyration": 0.3},
                "two": {"proximal": ["C"], "distal": ["D"], "mass": 0.05, "com": 0.5, "gyration": 0.25},
            }
        },
        "light.yaml",
        "light",
    )
    truth = body.build(m, light, "M").com()
    lost = {k: v.copy() for k, v in m.items()}
    lost["D"][100:130] = np.nan
    frame = body.build(lost, light, "M")
    np.testing.assert_array_equal(np.flatnonzero(frame.filled), np.arange(100, 130))
    assert np.abs(frame.com() - truth).max() < 2e-3
    assert np.abs(np.diff(frame.com() - truth, axis=0)).max() < 2e-4
    assert "two is not seen in 30 frames" in frame.notes[0]


def test_less_than_nine_tenths_of_the_body_is_no_com() -> None:
    """Where a heavy segment is unseen the CoM is NaN in those frames; where it is never seen there is none, and it is named."""
    _, m = two_rods()
    m["D"][100:130] = np.nan
    com = body.build(m, two_set(), "M").com()
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(com[:, 0])), np.arange(100, 130))
    del m["D"]
    frame = body.build(m, two_set(), "M")
    assert np.isnan(frame.com()).all()
    assert frame.missing == ["two (D)"]


def test_an_unseen_marker_behind_a_made_point_is_named() -> None:
    """A Plug-in Gait thigh without RASI names RASI, not the hip centre made from it."""
    mine = named("plug-in-gait")
    labels = {x for p in mine.points.values() for k in ("mean", "at", "from", "to", "asis", "psis") for x in p.get(k, ())}
    labels |= {x for s in mine.segments for x in s.markers}
    rng = np.random.default_rng(4)
    markers = {x: rng.normal(size=(20, 3)) for x in sorted(labels - set(mine.points) - {"RASI"})}
    missing = dict(entry.split(" (") for entry in body.build(markers, mine, "M").missing)
    assert missing["thigh_right"] == "RASI)"
    assert "hand_right" not in missing


# -- forces -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1.0, 2.0, 2.5, 4.17, 9.0, 10.0])
def test_averages_are_centred(width: float) -> None:
    """Weights are symmetric, sum to one, and give the exact mean of t^2's linear interpolant."""
    w = forces.box_weights(width)
    j = np.arange(len(w)) - len(w) // 2
    np.testing.assert_allclose(w, w[::-1])
    assert w.sum() == pytest.approx(1.0)
    fine = np.linspace(-width / 2, width / 2, 200001)
    assert w @ (j**2.0) == pytest.approx(float(np.mean(np.interp(fine, j, j**2.0))), rel=1e-4)


@pytest.mark.parametrize(("rate", "force_rate"), [(100, 1000), (120, 1080), (240, 1000), (100, 100), (200, 100), (60, 960)])
def test_forces_do_not_shift_in_time(rate: int, force_rate: int) -> None:
    """A ramp arrives exactly, and a 3 Hz sine with a time error below 10 us, whatever the two rates; the ends included."""
    t, frames = np.arange(4 * force_rate + 1) / force_rate, np.arange(4 * rate) / rate
    sine = np.sin(2 * np.pi * 3.0 * t)
    got = forces.at_frames(np.column_stack([5.0 + 2.0 * t, sine]), t, frames)
    np.testing.assert_allclose(got[:, 0], 5.0 + 2.0 * frames, atol=1e-9)
    inner = slice(rate, 3 * rate)
    phase = np.mean(got[inner, 1] * np.exp(-2j * np.pi * 3.0 * frames[inner])) * 2j
    assert abs(np.angle(phase)) / (2 * np.pi * 3.0) < 1e-5


def test_outside_the_force_record_is_nothing() -> None:
    """Frames before and after the forces are NaN; the first and last frame inside are not."""
    t, frames = 0.5 + np.arange(1001) / 1000.0, np.arange(200) / 100.0
    got = forces.at_frames(np.ones((1001, 1)), t, frames)[:, 0]
    np.testing.assert_array_equal(np.isfinite(got), (frames > 0.499) & (frames < 1.501))


def standing(n: int = 1001, left: float = 0.4, load: float = 700.0) -> list[Plate]:
    """Two plates at 1 kHz that share a load, CoPs at x = -0.1 and 0.15, at different heights of 0 and 0."""
    t = np.arange(n) / 1000.0
    out = []
    for share, x, foot in ((left, -0.10, "left"), (1 - left, 0.15, "right")):
        force = np.tile([10.0 * share, -5.0 * share, load * share], (n, 1))
        corners = np.array([[x + 0.1, 0.3, 0], [x - 0.1, 0.3, 0], [x - 0.1, -0.3, 0], [x + 0.1, -0.3, 0.0]])
        out.append(Plate(t, force, np.tile([x, 0.05, 0.0], (n, 1)), np.full(n, 0.2), corners, foot))
    return out


def test_two_plates_make_one_zmp() -> None:
    """The net ZMP is the load-weighted mean of the two CoPs, each foot keeps its own, forces add."""
    got = forces.net(standing(), np.arange(100) / 100.0)
    np.testing.assert_allclose(got.zmp, np.tile([0.4 * -0.10 + 0.6 * 0.15, 0.05, 0.0], (100, 1)))
    np.testing.assert_allclose(got.grf, np.tile([10.0, -5.0, 700.0], (100, 1)))
    np.testing.assert_allclose(got.feet["left"][1][:, 0], -0.10)
    np.testing.assert_allclose(got.feet["right"][0][:, 2], 420.0)


def test_the_zmp_lies_in_the_plates_plane_without_horizontal_moment() -> None:
    """On plates of unequal height the wrench of all plates has no horizontal moment about the ZMP at their mean height."""
    plates = standing()
    plates[1].cop[:, 2] = 0.10
    got = forces.net(plates, np.arange(50) / 100.0)
    assert got.surface == pytest.approx(0.05)
    moment = np.sum([np.cross(p.cop[0] - got.zmp[20], p.force[0]) for p in plates], axis=0)
    np.testing.assert_allclose(moment[:2], 0.0, atol=1e-9)


def test_an_empty_plate_moves_nothing_and_a_light_foot_still_counts() -> None:
    """A plate light for long counts as zero whatever its zero error; 15 N for 50 ms keep their place."""
    plates = standing()
    plates[0].force[:] = [1.0, 1.0, 12.0]
    plates[0].cop[200:] = np.nan  # empty from 0.2 s on
    got = forces.net(plates, np.arange(100) / 100.0)
    np.testing.assert_allclose(got.zmp[30:, 0], 0.15)
    np.testing.assert_allclose(got.grf[30:, 2], 420.0)
    plates = standing()
    plates[0].force[500:550] = [0.0, 0.0, 15.0]
    plates[0].cop[500:550] = np.nan
    got = forces.net(plates, np.arange(100) / 100.0)
    assert got.grf[52, 2] == pytest.approx(435.0)
    assert got.zmp[52, 0] == pytest.approx((15 * -0.10 + 420 * 0.15) / 435.0)


def test_a_loaded_plate_without_cop_gives_force_and_no_zmp() -> None:
    """Where a loaded plate lost its CoP the net force stands, the ZMP is NaN, and a note says so."""
    plates = standing()
    plates[1].cop[400:420] = np.nan
    got = forces.net(plates, np.arange(100) / 100.0)
    assert np.isnan(got.zmp[41]).all()
    assert np.isfinite(got.zmp[30:39]).all()
    np.testing.assert_allclose(got.grf[:, 2], 700.0)
    assert "no CoP in 20 samples" in got.notes[0]


def test_missing_shear_stays_missing() -> None:
    """A plate without horizontal forces gives a vertical force and a ZMP, and no shear."""
    plates = standing()
    for p in plates:
        p.force[:, :2] = np.nan
    got = forces.net(plates, np.arange(100) / 100.0)
    assert np.isnan(got.grf[:, :2]).all()
    np.testing.assert_allclose(got.zmp[:, 0], 0.05)


# -- CoM from forces --------------------------------------------------------------------------------------------------


def pendulum(n: int = 3000, rate: float = 100.0, height: float = 0.95, mass: float = 70.0) -> tuple[Array, Array, Array, Array]:
    """Sway of a body without angular momentum: time, CoM, GRF, ZMP."""
    t = np.arange(n) / rate
    com, acc = np.zeros((n, 3)), np.zeros((n, 3))
    for k, tones in enumerate((((0.10, 12e-3), (0.45, 6e-3), (1.1, 2e-3)), ((0.07, 15e-3), (0.8, 3e-3)))):
        for f, size in tones:
            w = 2 * np.pi * f
            com[:, k] += size * np.sin(w * t + f)
            acc[:, k] -= size * w**2 * np.sin(w * t + f)
    com += [0.02, -0.03, height]
    zmp = np.column_stack([com[:, :2] - acc[:, :2] * height / G, np.zeros(n)])
    return t, com, mass * (acc + np.array([0.0, 0.0, G])), zmp


def test_the_com_comes_back_from_the_forces() -> None:
    """Sway between 0.07 and 1.1 Hz is recovered to 0.5 mm, ends included, and to 0.05 mm but for its mean."""
    t, com, grf, zmp = pendulum()
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    assert np.abs(got - com).max() < 5e-4
    assert (got - com).std(axis=0).max() < 5e-5


def test_force_noise_and_a_zero_error_stay_bounded() -> None:
    """1 N of noise on the shear and a zero error of 4 N, which a plain double integral turns into metres, leave less than 1 mm."""
    t, com, grf, zmp = pendulum()
    grf = grf + np.random.default_rng(5).normal(size=grf.shape) + np.array([4.0, 0.0, 0.0])
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    plain = np.cumsum(np.cumsum(grf[:, 0] / 70.0)) * 1e-4
    assert np.abs(got - com)[:, 0].max() < 1e-3
    assert np.abs(plain).max() > 1.0


def test_gaps_in_the_force_leave_gaps_in_its_com() -> None:
    """NaN in the ZMP is NaN in the CoM; runs shorter than a second are not integrated."""
    t, com, grf, zmp = pendulum()
    zmp[1000:1010] = np.nan
    zmp[1060] = np.nan
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    assert np.isnan(got[1000:1061]).all()
    assert np.abs(got - com)[:1000].max() < 2e-3


# -- all together -----------------------------------------------------------------------------------------------------


def person(n: int = 600) -> Recording:
    """A rod that sways on two plates, with feet."""
    t, com, grf, zmp = pendulum(n)
    up = np.array([0.0, 0.0, 1.0])
    markers = {"A": com - 0.4 * up, "B": com + 0.6 * up}
    feet = {"LH": (-0.15, -0.08), "LT": (-0.2, 0.15), "RH": (0.15, -0.08), "RT": (0.22, 0.15)}
    markers |= {k: np.tile([x, y, 0.03], (n, 1)) for k, (x, y) in feet.items()}
    share = (0.15 - zmp[:, :1]) / 0.30
    plates = [
        Plate(t, grf * s, np.column_stack([np.full(n, x), zmp[:, 1], np.zeros(n)]), np.zeros(n), None, foot)
        for s, x, foot in ((share, -0.15, "left"), (1 - share, 0.15, "right"))
    ]
    return Recording(t, 100.0, markers, plates=plates, mass=70.0)


FEET = {"left": ["LH", "LT"], "right": ["RH", "RT"], "half_width": 0.02}


def test_a_recording_becomes_its_tables(tmp_path: Path) -> None:
    """Frames and coverage have exactly the columns of their tables and survive writing and reading."""
    got = run(person(), rod_set(**FEET))
    tables.write("signals", got.frames, tmp_path / "s.parquet")
    tables.write("coverage", pd.DataFrame([got.coverage | {"notes": "[]"}]), tmp_path / "c.parquet")
    pd.testing.assert_frame_equal(tables.read("signals", tmp_path / "s.parquet"), got.frames, check_dtype=False)
    assert got.coverage["com_method"] == "table"
    assert got.coverage["limitation"] == ""


def test_a_pendulum_obeys_its_equation_in_the_table() -> None:
    """In the columns, x'' = g/z (x - p) and F = m x'' hold away from the edges, to what the filter's reach leaves (1 mm/s2)."""
    f = run(person(3000), rod_set(**FEET)).frames
    inner = ~f["edge"]
    w2 = G / 0.95
    for a in "xy":
        rest = f[f"com_ddot_{a}"] - w2 * (f[f"com_lp_{a}"] - f[f"zmp_lp_{a}"])
        assert rest[inner].abs().max() < 1e-3
        assert (f[f"com_{a}"] - f[f"com_force_{a}"]).abs().max() < 2e-3
    assert f["grf_z"].mean() == pytest.approx(70.0 * G)


def test_support_limits_come_from_the_loaded_feet() -> None:
    """Borders are the outermost markers widened as the set says; a foot lifted for a second does not count meanwhile."""
    who = person(1000)
    f = run(who, rod_set(**FEET)).frames
    for name, value in (("left", -0.22), ("right", 0.24), ("back", -0.10), ("front", 0.17)):
        np.testing.assert_allclose(f[f"limit_{name}"], value)
    who.plates[0].force[300:400] = 0.0
    who.plates[0].cop[300:400] = np.nan
    f = run(who, rod_set(**FEET)).frames
    assert f["limit_left"][350] == pytest.approx(0.13)
    assert f["limit_left"][200] == pytest.approx(-0.22)


def test_support_falls_back_to_plates_and_says_so() -> None:
    """Without foot markers the plates' corners bound the support; without those nothing does."""
    who = person()
    for p in who.plates:
        p.corners = np.array([[0.3, 0.4, 0], [-0.3, 0.4, 0], [-0.3, -0.4, 0], [0.3, -0.4, 0.0]])
    bare = rod_set()
    got = run(who, bare)
    assert got.coverage["support"] == "plates"
    assert got.frames["limit_front"].iloc[0] == 0.4
    for p in who.plates:
        p.corners = None
    got = run(who, bare)
    assert got.coverage["support"] == "none"
    assert got.frames["limit_left"].isna().all()


def mirrored(who: Recording) -> Recording:
    """The same recording seen in a mirror: x turned round, left and right exchanged."""
    flip = np.array([-1.0, 1.0, 1.0])
    swap = {"L": "R", "R": "L"}
    markers = {swap.get(k[0], k[0]) + k[1:]: v * flip for k, v in who.markers.items()}
    other = {"left": "right", "right": "left"}
    plates = [replace(p, force=p.force * flip, cop=p.cop * flip, free_moment=-p.free_moment, foot=other[p.foot]) for p in who.plates]
    return replace(who, markers=markers, plates=plates[::-1])


def test_a_mirrored_recording_gives_mirrored_signals() -> None:
    """x changes its sign, left and right change places, angular momentum changes as an axial vector; nothing else changes."""
    here, there = run(person(), rod_set(**FEET)).frames, run(mirrored(person()), rod_set(**FEET)).frames
    swap = {"left": "right", "right": "left"}
    for c in tables.TABLES["signals"]:
        if c.kind != "float" or c.name == "time":
            continue
        parts = [swap.get(p, p) for p in c.name.split("_")]
        sign = -1.0 if parts[-1] == "x" or c.name in ("limit_left", "limit_right") else 1.0
        if c.name.startswith("ang_mom"):
            sign = -sign if parts[-1] == "x" else -1.0
        np.testing.assert_allclose(there["_".join(parts)], sign * here[c.name], atol=1e-9, err_msg=c.name)


def test_filled_markers_are_flagged_only_where_the_com_uses_them() -> None:
    """A filled rod marker flags its frame, a filled foot marker does not."""
    who = person()
    who.filled = {"A": np.arange(600) == 5, "LH": np.arange(600) == 9}
    np.testing.assert_array_equal(np.flatnonzero(run(who, rod_set(**FEET)).frames["filled"]), [5])


def test_forces_alone_give_a_com_and_say_what_it_cannot() -> None:
    """Without markers the CoM is that of the forces, its height from participants.tsv, and the limitation says where it stops."""
    who = replace(person(3000), markers={})
    got = run(who, None)
    assert got.coverage["com_method"] == "force"
    assert got.coverage["height_com"] == pytest.approx(0.56 * 1.75, abs=1e-3)
    assert "same forces as the ZMP" in got.coverage["limitation"]
    assert any("0.56 x 1.75 m" in n for n in got.notes)


def test_a_cop_alone_is_welcome_and_limited() -> None:
    """A CoP without forces gives its ZMP, no CoM, no mass, and a limitation; nothing fails."""
    t, _, _, zmp = pendulum()
    alone = Plate(t, np.full((3000, 3), np.nan), zmp, np.full(3000, np.nan))
    got = run(Recording(t, 100.0, plates=[alone]), None, Participant("sub-01"))
    np.testing.assert_allclose(columns(got.frames, "zmp"), zmp)
    np.testing.assert_allclose(got.frames["zmp_lp_x"], got.frames["zmp_x"], atol=2e-3)
    assert got.coverage["com_method"] == "none"
    assert "CoP without forces" in got.coverage["limitation"]
    assert "no CoM" in got.coverage["limitation"]


def test_the_labs_own_com_is_used_and_compared() -> None:
    """The file's CoM stands in where no segment does, and where both are their rms distance is given."""
    who = person()
    truth = who.markers["A"] + [0.0, 0.0, 0.4]
    who.derived = {"CentreOfMass": truth + np.array([0.003, 0.0, 0.004])}
    got = run(who, rod_set(**FEET))
    assert got.coverage["com_method"] == "table"
    assert got.coverage["lab_distance"] == pytest.approx(0.005)
    got = run(replace(who, markers={}), None)
    assert got.coverage["com_method"] == "lab"
    np.testing.assert_allclose(columns(got.frames, "com"), truth + np.array([0.003, 0.0, 0.004]))


def test_the_mass_comes_from_the_nearest_witness() -> None:
    """This trial's plates, else the subject's other trials, else participants.tsv, else unknown; each but the first is noted."""
    who = person()
    assert run(who, None).coverage["mass"] == 70.0
    who.mass = float("nan")
    assert signals(who, SOMEBODY, None, cutoff=2.0, subject_mass=71.0).coverage["mass"] == 71.0
    got = run(who, None, Participant("sub-01", 68.0))
    assert got.coverage["mass"] == 68.0
    assert any("participants.tsv" in n for n in got.notes)
    assert np.isnan(run(who, None, Participant("sub-01")).coverage["mass"])


def test_missing_segments_are_named_with_their_markers() -> None:
    """A set that finds only part of the body gives no CoM of its own and names what is missing."""
    who = person()
    who.plates = []
    mine = parse(
        {
            "segments": {
                "rod": {"proximal": ["A"], "distal": ["B"], "mass": 0.5, "com": 0.4, "gyration": 0.3},
                "hat": {"proximal": ["B"], "distal": ["TOP"], "mass": 0.5, "com": 0.4, "gyration": 0.3},
            }
        },
        "hat.yaml",
        "hat",
    )
    got = run(who, mine)
    assert got.coverage["missing_segments"] == "hat (TOP)"
    assert got.coverage["mass_share"] == 0.5
    assert got.coverage["com_method"] == "none"
    assert "segments of only 50%" in got.coverage["limitation"]


def test_a_part_holds_all_its_trials(tmp_path: Path) -> None:
    """Trials of a subject share the mass of those that tell it; a trial too slow for the filter has its reason and no frames."""
    second = replace(person(), mass=float("nan"), trial=replace(TRIAL, trial="second"))
    slow = replace(person(), trial=replace(TRIAL, trial="slow"))
    slow.time, slow.rate = slow.time * 50.0, 2.0
    frames, coverage = of_part([person(), second, slow], {"sub-01": SOMEBODY}, "auto", cutoff=2.0)
    assert list(frames["trial"].unique()) == [TRIAL.trial, "second"]
    assert list(coverage["mass"][:2]) == [70.0, 70.0]
    assert "other trials" in coverage["notes"][1]
    assert "2 Hz at 2 frames" in coverage["limitation"][2]
    tables.write("signals", frames, tmp_path / "s.parquet")
    tables.write("coverage", coverage, tmp_path / "c.parquet")
    nothing, row = of_part([slow], {}, "auto", cutoff=2.0)
    tables.write("signals", nothing, tmp_path / "s.parquet")
    assert len(row) == 1


# -- public recordings ------------------------------------------------------------------------------------------------


def recorded(folder: Path, *files: str, task: str = "quiet", who: Participant = SOMEBODY, markers: MarkerSet | None = None) -> Signals:
    from plumbline.recording import assemble

    got = assemble(Trial("t", "sub-01", "", task, "", "01", tuple(folder / f for f in files)))
    name = match(got.markers)
    return run(got, markers or (named(name) if name else None), who)  # type: ignore[arg-type]


def test_plug_in_gait_com_is_near_the_labs(shared_data: Path) -> None:
    """In a walking child the table's CoM lies 27 mm from Plug-in Gait's own, nearly all of it a constant distance behind it."""
    got = recorded(shared_data, "c3d_wholebody/PiG_Motion-FlatFoot-Full.c3d", task="walk")
    assert got.coverage["marker_set"] == "plug-in-gait"
    assert got.coverage["lab_distance"] == pytest.approx(0.0270, abs=5e-4)
    apart = columns(got.frames, "com_table") - columns(got.frames, "com_lab")
    assert np.nanstd(apart, axis=0).max() < 5e-3


def test_a_person_at_rest_stands_over_the_zmp(shared_data: Path) -> None:
    """In a static trial the table's CoM is within 15 mm (forward) and 4 mm (sideways) of the ZMP, and the forces' CoM within 4 mm of it."""
    f = recorded(shared_data, "nimble_subject4/static1.trc", "nimble_subject4/static1_grf.mot").frames
    apart = columns(f, "com") - columns(f, "zmp")
    assert abs(apart[:, 0].mean()) < 4e-3
    assert abs(apart[:, 1].mean()) < 15e-3
    own = columns(f, "com_force") - columns(f, "zmp")
    assert np.abs(own[:, :2].mean(axis=0)).max() < 4e-3


def test_a_lower_body_has_no_table_com(shared_data: Path) -> None:
    """Legs alone are 40 % of the mass: their set is found, the missing segments are named, the CoM is that of the forces."""
    got = recorded(shared_data, "c3d_wholebody/FunctionalStatic.c3d")
    assert got.coverage["mass_share"] == pytest.approx(0.397, abs=2e-3)
    assert got.coverage["com_method"] == "force"
    assert "head (LFHD, RFHD, LBHD, RBHD, C7)" in got.coverage["missing_segments"]
    assert got.frames["com_table_x"].isna().all()


def test_filtered_files_are_known(shared_data: Path) -> None:
    """Simulated sensors with white noise are raw; .trc and .mot that went through a low-pass are not."""
    where = shared_data / "hidden_effect" / "clean" / "raw"
    raw = recorded(where, "sub-01/sub-01_task-lateral_run-01.c3d", task="lateral", markers=load(where / "markerset.yaml"))
    assert raw.coverage["filtered_before"] is False
    for name in ("static1", "squats1", "walking1"):
        got = recorded(shared_data, f"nimble_subject4/{name}.trc", f"nimble_subject4/{name}_grf.mot", task="walk")
        assert got.coverage["filtered_before"] is True
        assert any("markers and forces were low-passed" in n for n in got.notes)


def test_the_moment_of_the_ground_is_the_rate_of_angular_momentum(shared_data: Path) -> None:
    """With a rolling trunk, (p - c) x F and dL/dt about the forward axis agree: slope 1 +- 0.05, correlation above 0.98."""
    from plumbline import filters

    where = shared_data / "hidden_effect" / "ang_mom" / "raw"
    got = recorded(where, "sub-01/sub-01_task-lateral_run-02.c3d", task="lateral", markers=load(where / "markerset.yaml"))
    t = got.frames["time"].to_numpy()
    moment = np.cross(columns(got.frames, "zmp") - columns(got.frames, "com"), columns(got.frames, "grf"))[:, 1:2]
    rate = filters.derivatives(filters.low_pass(columns(got.frames, "ang_mom")[:, 1:2], t, 3.0), t)[0]
    quiet = ((t > 1.7) & (t < 4.5)) | ((t > 5.8) & (t < 8.5))
    x, y = rate[quiet, 0], filters.low_pass(moment, t, 3.0)[quiet, 0]
    assert np.polyfit(x, y, 1)[0] == pytest.approx(1.0, abs=0.05)
    assert np.corrcoef(x, y)[0, 1] > 0.98
