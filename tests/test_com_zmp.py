"""The plant against closed forms; the interval against repeated experiments."""

import numpy as np
import pytest

from plumbline.models.com_zmp import bounded_motion, com_acceleration, fit, free_motion, zmp_error


def test_a_com_at_rest_over_its_zmp_stays_there() -> None:
    """x = p: no acceleration, no error."""
    x = np.full(5, 0.3)
    assert np.all(com_acceleration(x, x, 9.0) == 0)
    assert np.all(zmp_error(np.zeros(5), x - x, 9.0) == 0)


def test_error_is_the_distance_between_measured_and_modelled_zmp() -> None:
    """With p_model = x - x''/w2, the error is p_model - p."""
    x, p, a, w2 = 0.10, 0.03, 0.5, 9.0
    assert zmp_error(np.array([a]), np.array([x - p]), w2)[0] == pytest.approx((x - a / w2) - p)


def test_bounded_response_to_a_sine() -> None:
    """p = sin(ct) gives x = sin(ct) w2 / (w2 + c2), away from the ends."""
    t = np.arange(0, 20, 0.005)
    x, v = bounded_motion(np.sin(2 * t), 3.0, 200.0)
    np.testing.assert_allclose(x[800:-800], (np.sin(2 * t) * 9 / 13)[800:-800], atol=1e-5)
    np.testing.assert_allclose(v[800:-800], (2 * np.cos(2 * t) * 9 / 13)[800:-800], atol=1e-4)


def test_free_run_reproduces_a_fall() -> None:
    """A ZMP stuck at 0.1 m and a CoM running away from it: the free run follows to a micrometre."""
    t = np.arange(0, 1.2, 0.005)
    x = 0.1 + 0.01 * np.cosh(3 * t)
    np.testing.assert_allclose(free_motion(x, np.full(len(t), 0.1), 3.0, 200.0)[0], x, atol=1e-6)


def test_a_constant_offset_does_not_bias_w2() -> None:
    """A ZMP that reads 20 mm too far right leaves w2 where it is, and comes out as the constant."""
    rng = np.random.default_rng(3)
    lever = rng.normal(0, 0.02, 400)
    got = fit(9.0 * lever + rng.normal(0, 1e-3, 400), lever - 0.02, np.arange(400) // 20)
    assert got is not None
    assert got.w2 == pytest.approx(9.0, rel=5e-3)
    assert got.constant == pytest.approx(9.0 * 0.02, rel=5e-3)


def test_intervals_cover_under_correlated_errors() -> None:
    """With errors that are shared within a locus, the clustered interval covers 0.90-0.98 of 400 repetitions."""
    rng, hits = np.random.default_rng(4), 0
    cluster = np.repeat(np.arange(24), 15)
    for _ in range(400):
        lever = rng.normal(0, 0.02, 360) + np.repeat(rng.normal(0, 0.02, 24), 15)
        shared = np.repeat(rng.normal(0, 0.03, 24), 15) + rng.normal(0, 0.01, 360)
        got = fit(9.0 * lever + shared, lever, cluster)
        assert got is not None
        low, high = got.omega_interval()
        hits += low <= 3.0 <= high
    assert 0.90 <= hits / 400 <= 0.98


def test_nothing_is_said_where_the_com_does_not_move() -> None:
    """A lever that does not vary cannot tell w2 from the constant."""
    assert fit(np.zeros(100), np.full(100, 0.01), np.zeros(100, int)) is None
