"""Low-pass, derivatives, edges and the look at the noise band."""

import numpy as np
import pytest

from plumbline import filters, noise_band
from plumbline.errors import Refused

RATE = 100.0
TIME = np.arange(6000) / RATE


def gain(frequency: float, cutoff: float, rate: float = RATE) -> complex:
    """Complex gain of the filter at one frequency, by projection on sine and cosine over whole periods in the middle."""
    time = np.arange(round(60 * rate)) / rate
    y = filters.low_pass(np.sin(2 * np.pi * frequency * time), time, cutoff)
    inner = (time >= 20.0) & (time < 40.0)
    turn = np.exp(-2j * np.pi * frequency * time[inner])
    return complex(2j * np.mean(y[inner] * turn))


@pytest.mark.parametrize(("cutoff", "rate"), [(2.0, 100.0), (2.0, 240.0), (6.0, 60.0), (10.0, 100.0)])
def test_the_corner_is_that_of_the_double_pass(cutoff: float, rate: float) -> None:
    """A sine at the cut-off leaves with 1/sqrt(2) of its size, to 0.1 %, and without any delay."""
    got = gain(cutoff, cutoff, rate)
    assert abs(got) == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert abs(np.angle(got)) < 1e-4


def test_the_roll_off_is_that_of_two_second_order_passes() -> None:
    """The gain follows 1/(1 + (sqrt(2) - 1) (tan(pi f/fs)/tan(pi fc/fs))^4)."""
    for f in (0.5, 1.0, 3.0, 5.0, 8.0):
        ratio = np.tan(np.pi * f / RATE) / np.tan(np.pi * 2.0 / RATE)
        assert abs(gain(f, 2.0)) == pytest.approx(1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * ratio**4), rel=2e-3)


def test_no_time_is_lost() -> None:
    """The answer to an impulse is symmetric in time."""
    x = np.zeros(1001)
    x[500] = 1.0
    y = filters.low_pass(x, np.arange(1001) / RATE, 2.0)
    np.testing.assert_allclose(y, y[::-1], atol=1e-9)


def test_constants_and_lines_pass_to_the_last_frame() -> None:
    """A line leaves as it came, ends included."""
    y = filters.low_pass(3.0 - 0.2 * TIME, TIME, 2.0)
    np.testing.assert_allclose(y, 3.0 - 0.2 * TIME, atol=1e-6)


def test_gaps_stay_and_do_not_spread() -> None:
    """NaN stays NaN, and what is filtered on one side of a gap does not depend on the other side."""
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.normal(size=(1000, 2)), axis=0)
    x[400:410, 0] = np.nan
    y = filters.low_pass(x, TIME[:1000], 2.0)
    assert np.isnan(y[400:410]).all()
    assert np.isfinite(np.delete(y, np.arange(400, 410), axis=0)).all()
    other = x.copy()
    other[410:] = 7.0
    np.testing.assert_array_equal(filters.low_pass(other, TIME[:1000], 2.0)[:400], y[:400])
    np.testing.assert_allclose(filters.low_pass(x[410:], TIME[:590], 2.0), y[410:])


def test_a_cut_off_near_the_clock_is_refused() -> None:
    """5 Hz on ten frames per second cannot be filtered and says so."""
    with pytest.raises(Refused, match="5 Hz at 10 frames"):
        filters.low_pass(np.zeros(100), np.arange(100) / 10.0, 5.0)


def test_derivatives_of_a_sine() -> None:
    """First and second derivative of a 1 Hz sine at 100 Hz are right to 1e-5 inside a run and NaN in a gap."""
    w = 2 * np.pi
    x = np.sin(w * TIME[:500])[:, None].copy()
    x[200:203] = np.nan
    v, a = filters.derivatives(x, TIME[:500])
    inner = np.r_[5:195, 208:495]
    np.testing.assert_allclose(v[inner, 0], w * np.cos(w * TIME[inner]), atol=1e-5 * w)
    np.testing.assert_allclose(a[inner, 0], -(w**2) * np.sin(w * TIME[inner]), atol=1e-5 * w**2)
    assert np.isnan(v[200:203]).all()


def test_derivatives_are_exact_on_parabolas_to_the_ends() -> None:
    """t^2 has the velocity 2 t and the acceleration 2 in every frame."""
    t = TIME[:50]
    v, a = filters.derivatives((t**2)[:, None], t)
    np.testing.assert_allclose(v[:, 0], 2 * t, atol=1e-10)
    np.testing.assert_allclose(a[:, 0], 2.0, atol=1e-8)


def test_edges_hold_what_an_end_can_do() -> None:
    """Outside the flagged frames a step beyond the end of a record changes the filtered signal by less than 2 % of the step."""
    long = np.zeros(1000)
    long[600:] = 1.0
    short = filters.low_pass(long[:600], TIME[:600], 2.0)
    whole = filters.low_pass(long, TIME[:1000], 2.0)
    flagged = filters.edges(np.ones(600, dtype=bool), RATE, 2.0)
    assert flagged[0]
    assert flagged[-1]
    assert not flagged[300]
    assert np.abs(short - whole[:600])[~flagged].max() < 0.02
    assert np.abs(short - whole[:600])[flagged].max() > 0.1


def test_edges_surround_a_gap() -> None:
    """Frames on both sides of a gap are flagged, and the gap itself."""
    good = np.ones(600, dtype=bool)
    good[300:310] = False
    flagged = filters.edges(good, RATE, 2.0)
    span = int(np.ceil(filters.reach(2.0) * RATE))
    np.testing.assert_array_equal(np.flatnonzero(flagged[100:500]) + 100, np.arange(300 - span, 310 + span))


def test_noise_tells_raw_from_filtered() -> None:
    """Sway with 0.3 mm of white noise is raw; the same after a 10 Hz low-pass is not; rounding to 1 um does not make it raw."""
    rng = np.random.default_rng(2)
    raw = 0.01 * np.sin(2 * np.pi * 0.4 * TIME) + 3e-4 * rng.normal(size=len(TIME))
    smooth = filters.low_pass(raw, TIME, 10.0)
    assert noise_band.band_is_empty(raw, RATE, noise_band.EMPTY_MARKER) is False
    assert noise_band.band_is_empty(smooth, RATE, noise_band.EMPTY_MARKER) is True
    assert noise_band.band_is_empty(np.round(smooth, 6), RATE, noise_band.EMPTY_MARKER) is True
    assert noise_band.band_is_empty(raw[:50], RATE, noise_band.EMPTY_MARKER) is None
