"""The weak form against polynomials, exponentials and noise of known size."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from plumbline.weak import Bump, white_noise_sd


@pytest.mark.parametrize("exponent", [3, 4, 6])
def test_polynomials_are_integrated_exactly(exponent: int) -> None:
    """A constant has no derivative, a line no curvature, a parabola a constant one: to rounding, far from the origin too."""
    bump, t = Bump(0.4, exponent, 100.0), np.arange(300) / 100
    for offset in (0.0, 1000.0):
        x = offset + 3.0 * t - 2.0 * t**2
        inside = slice(bump.reach, -bump.reach)
        np.testing.assert_allclose(bump.second(x)[inside], -4.0, atol=1e-7)
        np.testing.assert_allclose(bump.derivative(offset + 3.0 * t)[inside], 3.0, atol=1e-8)
        np.testing.assert_allclose(bump.mean(offset + 3.0 * t)[inside], (offset + 3.0 * t)[inside], atol=1e-9)


@pytest.mark.parametrize("rate", [50.0, 100.0, 240.0])
def test_solutions_of_the_plant_satisfy_the_weak_form(rate: float) -> None:
    """x = e^(wt) solves x'' = w2 x: the weak sides agree to 1e-5 relative although nothing was differentiated."""
    w, bump = 3.0, Bump(0.4, 4, rate)
    x = np.exp(w * np.arange(0, 3, 1 / rate))
    left, right = bump.second(x), w**2 * bump.mean(x)
    good = np.isfinite(left)
    np.testing.assert_allclose(left[good], right[good], rtol=1e-5)


def test_a_gap_spoils_exactly_the_bumps_that_touch_it() -> None:
    """One NaN makes the 2 reach + 1 bumps around it NaN, and no other."""
    bump = Bump(0.2, 4, 100.0)
    x = np.zeros(200)
    x[100] = np.nan
    bad = np.flatnonzero(~np.isfinite(bump.mean(x)))
    ends = set(range(bump.reach)) | set(range(200 - bump.reach, 200))
    assert set(bad) - ends == set(range(100 - bump.reach, 101 + bump.reach))


def test_a_record_shorter_than_the_bump_gives_nothing() -> None:
    """No window fits: all NaN, no error."""
    assert np.isnan(Bump(0.4, 4, 100.0).second(np.zeros(50))).all()


def test_too_slow_a_rate_is_refused() -> None:
    """Three samples on each side cannot carry a second derivative."""
    with pytest.raises(ValueError, match="needs 4"):
        Bump(0.1, 4, 30.0)


@settings(max_examples=20, deadline=None)
@given(st.floats(-3, 3), st.floats(0.1, 10))
def test_linear_and_mirrored(shift: float, scale: float) -> None:
    """Scaling, shifting or mirroring a signal scales or mirrors its derivative and ignores the shift."""
    x = np.cumsum(np.random.default_rng(1).normal(size=200)) * 0.01
    bump = Bump(0.3, 4, 100.0)
    np.testing.assert_allclose(bump.second(-scale * x + shift), -scale * bump.second(x), atol=1e-9 * scale + 1e-9)


def test_white_noise_is_measured_under_motion() -> None:
    """1 mm of white noise on a 5 cm sway is found within 3 %, with a hole in the record."""
    t = np.arange(0, 60, 0.01)
    x = 0.05 * np.sin(2 * t) + np.random.default_rng(2).normal(0, 1e-3, len(t))
    x[1000:1200] = np.nan
    assert white_noise_sd(x) == pytest.approx(1e-3, rel=0.03)
