"""The body: CoM and angular momentum of rods that fly, tumble and get lost."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_recording import XYZ, Array, rod_set

from plumbline import body, forces
from plumbline.markerset import MarkerSet, named, parse


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


# -- carried points -----------------------------------------------------------------------------------------------------

BENT: dict[str, Any] = {
    "points": {
        "NAVEL": {"at": ["HIP"], "from": ["HIP"], "to": ["NECK"], "share": {"F": 0.4, "M": 0.3}, "carried": ["P1", "P2", "P3"]},
        "XIPHOID": {"at": ["HIP"], "from": ["HIP"], "to": ["NECK"], "share": 0.7, "carried": ["T1", "T2", "T3", "T4"]},
    },
    "segments": {
        "thorax": {"proximal": ["NECK"], "distal": ["XIPHOID"], "mass": 0.5, "com": 0.5, "gyration": 0.3},
        "abdomen": {"proximal": ["XIPHOID"], "distal": ["NAVEL"], "mass": 0.3, "com": 0.5, "gyration": 0.3},
        "pelvis": {"proximal": ["NAVEL"], "distal": ["HIP"], "mass": 0.2, "com": 0.5, "gyration": 0.3},
    },
}
PELVIS = {"P1": (0.12, 0.1, 0.1), "P2": (-0.12, 0.1, 0.1), "P3": (0.0, -0.1, 0.12), "HIP": (0.0, 0.0, 0.0), "NAVEL": (0.0, 0.0, 0.15)}
THORAX = {
    **{"T1": (0.0, -0.1, 0.05), "T2": (0.0, -0.12, -0.1), "T3": (0.02, 0.09, 0.0), "T4": (0.0, 0.1, -0.1)},
    **{"NECK": (0.0, 0.0, 0.0), "XIPHOID": (0.0, 0.0, -0.15)},
}


def tilted(angle: Array, at: Array, shape: dict[str, tuple[float, float, float]]) -> dict[str, Array]:
    """Markers of a piece that leans forward by `angle` [rad] about its origin `at` [m]."""
    c, s, zero, one = np.cos(angle), np.sin(angle), 0.0 * angle, 1.0 + 0.0 * angle
    turn = np.stack([np.stack(row, -1) for row in ((one, zero, zero), (zero, c, s), (zero, -s, c))], axis=1)
    return {name: at + turn @ np.array(v) for name, v in shape.items()}


def bending(start: float = 0.0, n: int = 200) -> dict[str, Array]:
    """A person of three pieces who stands straight, then bends: the pelvis by 30, the thorax by 80 deg. Holds NAVEL and XIPHOID."""
    depth = np.clip(np.linspace(start - 0.2, 1.0, n), start, 1.0)
    hip = np.column_stack([0.0 * depth, -0.1 * depth, 0.9 + 0.0 * depth])
    pelvis = tilted(np.radians(30.0) * depth, hip, PELVIS)
    waist = np.radians(55.0) * depth
    neck = pelvis["NAVEL"] + 0.35 * np.column_stack([0.0 * waist, np.sin(waist), np.cos(waist)])
    return pelvis | tilted(np.radians(80.0) * depth, neck, THORAX)


def bent_set() -> MarkerSet:
    return parse(BENT, "bent.yaml", "bent")


def hidden(markers: dict[str, Array], *more: str) -> dict[str, Array]:
    return {k: v for k, v in markers.items() if k not in ("NAVEL", "XIPHOID", *more)}


def test_a_bent_trunk_of_rigid_pieces_is_followed_exactly() -> None:
    """Points put on the straight back while the person stands go with pelvis and thorax as the back bends; so does the CoM."""
    truth = bending()
    got = body.points(hidden(truth), bent_set(), "M")
    for name in ("NAVEL", "XIPHOID"):
        np.testing.assert_allclose(got[name], truth[name], atol=1e-9)
    frame = body.build(hidden(truth), bent_set(), "M")
    com = 0.25 * (truth["NECK"] + truth["XIPHOID"]) + 0.15 * (truth["XIPHOID"] + truth["NAVEL"]) + 0.1 * (truth["NAVEL"] + truth["HIP"])
    np.testing.assert_allclose(frame.com(), com, atol=1e-9)
    assert frame.notes == []


def test_carried_points_turn_and_shift_with_the_recording() -> None:
    """The whole recording turned about the vertical and shifted gives the same points, turned and shifted."""
    markers = {k: v + np.random.default_rng(5).normal(size=v.shape, scale=1e-3) for k, v in hidden(bending()).items()}
    c, s = np.cos(2.1), np.sin(2.1)
    turn, shift = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.array([3.0, -7.0, 0.4])
    base = body.points(markers, bent_set(), "F")
    moved = body.points({k: v @ turn.T + shift for k, v in markers.items()}, bent_set(), "F")
    for name in ("NAVEL", "XIPHOID"):
        np.testing.assert_allclose(moved[name], base[name] @ turn.T + shift, atol=1e-9)


@pytest.mark.parametrize(("sex", "share"), [("F", 0.4), ("M", 0.3), ("", 0.35)])
def test_a_share_may_differ_by_sex(sex: str, share: float) -> None:
    """Standing, the navel lies at the share of its sex, at the mean of both where the sex is not stated."""
    truth = bending()
    got = body.points(hidden(truth), bent_set(), sex)["NAVEL"][0]
    np.testing.assert_allclose(got, truth["HIP"][0] + share * (truth["NECK"][0] - truth["HIP"][0]), atol=1e-9)


def test_a_head_that_looks_ahead_stays_upright() -> None:
    """An upright point is straight above its base in every frame, as far as its share of the line says while the person stands."""
    head = {"at": ["NECK"], "from": ["HIP"], "to": ["NECK"], "share": 0.5, "upright": True}
    mine = parse({**BENT, "points": {**BENT["points"], "VERTEX": head}}, "bent.yaml", "bent")
    truth = bending()
    up = body.points(hidden(truth), mine, "M")["VERTEX"] - truth["NECK"]
    np.testing.assert_allclose(up, np.broadcast_to([0.0, 0.0, 0.5 * (0.15 + 0.35)], up.shape), atol=1e-9)


def test_a_trial_without_an_upright_moment_says_so() -> None:
    """Somebody who is bent from the first frame on still has a CoM, with the lean of the straightest frames in a note."""
    frame = body.build(hidden(bending(start=0.6)), bent_set(), "M")
    assert np.isfinite(frame.com()).all()
    assert len(frame.notes) == 1
    assert frame.notes[0].startswith("NAVEL, XIPHOID placed where the trunk leans 2")


def test_a_file_without_the_carrying_markers_keeps_the_straight_back() -> None:
    """With two of the thorax's markers XIPHOID stays on the line in each frame, the whole body is there, and a note says why."""
    truth = hidden(bending(), "T1", "T3")
    got = body.points(truth, bent_set(), "M")
    np.testing.assert_allclose(got["XIPHOID"], truth["HIP"] + 0.7 * (truth["NECK"] - truth["HIP"]), atol=1e-12)
    frame = body.build(truth, bent_set(), "M")
    assert frame.share == pytest.approx(1.0)
    assert frame.missing == []
    assert "XIPHOID on a straight line in every frame" in frame.notes[0]
    assert frame.notes[0].endswith("of T1, T2, T3, T4 only T2, T4 is seen")


def test_a_carrying_marker_lost_for_some_frames() -> None:
    """One of four lost changes nothing; with one of the pelvis's three lost the navel goes on smoothly, within 1 mm for 5 frames."""
    truth = bending()
    lost = {k: v.copy() for k, v in hidden(truth).items()}
    lost["T2"][120:130] = np.nan
    lost["P1"][150:155] = np.nan
    got = body.points(lost, bent_set(), "M")
    np.testing.assert_allclose(got["XIPHOID"], truth["XIPHOID"], atol=1e-9)
    error = np.abs(got["NAVEL"] - truth["NAVEL"]).max(axis=1)
    assert error[150:155].max() < 1e-3
    assert np.delete(error, np.arange(150, 155)).max() < 1e-9


def test_markers_that_tell_no_turn_keep_the_straight_back() -> None:
    """Carriers on one line, or never seen all at once, leave the point on its line, and a note says so."""
    truth = hidden(bending())
    line = truth | {"P3": (truth["P1"] + truth["P2"]) / 2.0}
    never = truth | {k: staggered(truth[k], i) for i, k in enumerate(("P1", "P2", "P3"))}
    for markers in (line, never):
        got = body.build(markers, bent_set(), "M")
        assert "NAVEL on a straight line in every frame" in got.notes[0]
        assert got.notes[0].endswith("P1, P2, P3 tell no turn")
        navel = body.points(markers, bent_set(), "M")["NAVEL"]
        np.testing.assert_allclose(navel, truth["HIP"] + 0.3 * (truth["NECK"] - truth["HIP"]), atol=1e-12)


def staggered(marker: Array, which: int) -> Array:
    """A marker unseen in every third frame, beginning with `which`."""
    out = marker.copy()
    out[which::3] = np.nan
    return out


def test_a_jump_of_a_carrying_marker_is_smoothed_and_the_bend_is_not() -> None:
    """With the clock known a jump of 5 mm in one marker gives the point a third of the acceleration, a slow bend goes within 0.2 mm."""
    truth = bending(n=800)
    time = np.arange(800) / 100.0
    smooth = body.points(hidden(truth), bent_set(), "M", time)["XIPHOID"]
    assert np.abs(smooth - truth["XIPHOID"])[50:-50].max() < 2e-4
    jumped = {k: v.copy() for k, v in hidden(truth).items()}
    jumped["T3"][400:, 2] += 5e-3
    kick = [np.abs(np.diff(body.points(jumped, bent_set(), "M", t)["XIPHOID"][300:500], 2, axis=0)).max() for t in (None, time)]
    assert kick[1] < kick[0] / 3.0


def test_the_markers_that_carry_stand_behind_the_segments() -> None:
    """A frame in which a carrying marker was filled counts as filled: it is among the inputs of the segments it carries."""
    assert body.inputs(bent_set(), ["pelvis"]) >= {"P1", "P2", "P3", "HIP", "NECK"}
    assert "T1" not in body.inputs(bent_set(), ["pelvis"])


def test_a_bent_back_lowers_the_unexplained_force_of_squats(shared_data: Path) -> None:
    """m y'' of squats' CoM comes nearer to the measured force than with the straight back: sd 0.054 against 0.079 m/s2."""
    from plumbline.recording import assemble
    from plumbline.study import Trial
    from plumbline.weak import Bump

    files = tuple(shared_data / "nimble_subject4" / f"squats1{end}" for end in (".trc", "_grf.mot"))
    got = assemble(Trial("t", "sub-04", "", "squats", "", "01", files))
    bump = Bump(0.3, 3, got.rate)
    force = forces.net(got.plates, got.time).grf
    straight = {k: v for k, v in got.markers.items() if k not in ("C7", "r.ASIS", "r.PSIS")}
    coms = [body.build(m, named("opencap"), "", got.time).com() for m in (got.markers, straight)]
    sd = [np.nanstd((bump.second(com) - bump.mean(force) / got.mass)[:, 1]) for com in coms]
    assert sd[0] == pytest.approx(0.054, abs=0.002)
    assert sd[1] == pytest.approx(0.079, abs=0.002)
