"""Rigid pieces: what goes with them, when they are upright, and what is lost with a marker."""

import numpy as np
import pytest
from made_recording import Array
from scipy.spatial.transform import Rotation

from plumbline import rigid

SHAPE = np.array([[0.10, 0.08, 0.0], [-0.10, 0.08, 0.01], [0.05, -0.09, 0.02], [-0.06, -0.08, 0.0]])
SPOT = np.array([0.01, 0.02, 0.25])
FIRST = np.arange(3)


def tumbling(n: int = 80, seed: int = 7) -> tuple[Array, Array, Rotation]:
    """Markers of a rigid piece that tumbles, and a point on it: (n, 4, 3), (n, 3)."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(np.cumsum(rng.normal(size=(n, 3), scale=0.1), axis=0))
    place = np.cumsum(rng.normal(size=(n, 3), scale=0.02), axis=0)
    moved = [turn.apply(a) + place for a in (*SHAPE, SPOT)]
    return np.stack(moved[:-1], axis=1), moved[-1], turn


def test_a_point_on_a_rigid_piece_is_followed_exactly() -> None:
    """Told in three frames only, a point on a tumbling piece is known in each."""
    markers, point, _ = tumbling()
    told = np.where(np.isin(np.arange(len(point)), FIRST)[:, None], point, 99.0)
    np.testing.assert_allclose(rigid.carry(told, markers, FIRST), point, atol=1e-9)


def test_a_lost_marker_of_four_costs_nothing_and_two_cost_the_frame() -> None:
    """Three markers tell a turn as well as four on a rigid piece; two tell none, and only those frames are lost."""
    markers, point, _ = tumbling()
    markers[20:30, 1] = np.nan
    markers[40:50, :2] = np.nan
    got = rigid.carry(point, markers, FIRST)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(got).any(axis=1)), np.arange(40, 50))
    seen = np.isfinite(got).all(axis=1)
    np.testing.assert_allclose(got[seen], point[seen], atol=1e-9)


def test_markers_on_one_line_carry_nothing() -> None:
    """Three markers on a line do not tell the turn about it: NaN, no guess."""
    markers, point, turn = tumbling()
    line = np.stack([markers[:, 0] + s * turn.apply([0.0, 0.0, 1.0]) for s in (0.0, 0.1, 0.3)], axis=1)
    assert np.isnan(rigid.carry(point, line, FIRST)).all()


def test_a_flat_piece_is_not_mirrored() -> None:
    """Markers in one plane carry a point off the plane to the right side of it, whatever the turn."""
    _, point, turn = tumbling(seed=11)
    flat = np.stack([point + turn.apply(a * [1.0, 1.0, 0.0] - [0.0, 0.0, 0.3]) for a in SHAPE], axis=1)
    np.testing.assert_allclose(rigid.carry(point, flat, FIRST), point, atol=1e-9)


def test_noise_of_the_markers_does_not_grow() -> None:
    """White noise of 1 mm leaves a point among the markers known to 0.5 mm (1 mm / sqrt 4), and no bias above 0.2 mm."""
    markers, _, turn = tumbling(n=2000)
    middle = markers.mean(axis=1)
    noisy = markers + np.random.default_rng(3).normal(size=markers.shape, scale=1e-3)
    error = rigid.carry(middle, noisy, np.arange(100)) - middle
    assert error.std() == pytest.approx(0.5e-3, rel=0.05)
    assert np.abs(turn.inv().apply(error).mean(axis=0)).max() < 2e-4


def sit_to_stand() -> tuple[Array, Array]:
    """Hips and shoulders: sits straight (1 deg) for 200 frames, leans 40 deg as it rises, stands leaning 3 deg for 100 frames."""
    lean = np.radians(np.concatenate([np.full(200, 1.0), np.linspace(1.0, 40.0, 50), np.linspace(40.0, 3.0, 50), np.full(100, 3.0)]))
    lean += np.linspace(0.0, 1e-3, len(lean))
    high = np.concatenate([np.full(200, 0.5), np.linspace(0.5, 0.9, 100), np.full(100, 0.9)])
    hips = np.column_stack([0.0 * high, 0.0 * high, high])
    return hips, hips + 0.5 * np.column_stack([0.0 * lean, np.sin(lean), np.cos(lean)])


def test_the_upright_moment_is_standing_not_sitting_straight() -> None:
    """Sitting with a straighter line than standing is not taken for the upright moment; the straightest of standing is."""
    moment = rigid.upright(*sit_to_stand())
    assert moment is not None
    assert moment.frames.min() >= 300 - 5
    assert moment.lean == pytest.approx(3.0, abs=0.1)


def test_the_upright_moment_may_be_missed() -> None:
    """A trial in which the line never comes nearer than 40 deg says so; one in which it is never seen has none."""
    hips, shoulders = sit_to_stand()
    moment = rigid.upright(hips[248:252], shoulders[248:252])
    assert moment is not None
    assert moment.lean > rigid.LEANS
    assert rigid.upright(hips, np.full_like(hips, np.nan)) is None
