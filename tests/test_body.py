"""The body: CoM and angular momentum of rods that fly, tumble and get lost."""

import numpy as np
import pytest
from made_recording import XYZ, Array, rod_set

from plumbline import body
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
