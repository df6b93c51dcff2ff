"""The simulated loci obey the closed forms they claim, start where they say and carry the noise they were asked for."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from plumbline.simulate.pendulum import Locus, loci

NEAR = {"omega": 2.740, "k1": 4.038, "k2": 0.875}
FAR = {"omega": 2.808, "k1": 2.204, "k2": 0.549}
STILL = {"marker_noise": 0.0, "cop_noise": 0.0, "feedback_sd": 0.0}


@pytest.mark.parametrize("gains", [NEAR, FAR])
def test_falling_loci_follow_the_hyperbola(gains: dict[str, float]) -> None:
    """With the ZMP at its limit x = p + (x0 - p) cosh wt + v0/w sinh wt, to 1e-10 m up to the fall."""
    w = gains["omega"]
    for locus in loci(16, **gains, **STILL, start="falling", seed=1):
        p = 0.1 if locus.side == "right" else -0.1
        t = locus.time
        x = p + (locus.x_true[0] - p) * np.cosh(w * t) + locus.v_true[0] / w * np.sinh(w * t)
        np.testing.assert_allclose(locus.p_true, p)
        np.testing.assert_allclose(locus.x_true, x, atol=1e-10)
        assert len(locus.switches) == 0


@pytest.mark.parametrize("gains", [NEAR, FAR])
def test_unsaturated_loci_follow_the_matrix_exponential(gains: dict[str, float]) -> None:
    """Inside the limits the loop is linear, x' = A x with A from omega, k1, k2, to 1e-10 m."""
    w2, k1, k2 = gains["omega"] ** 2, gains["k1"], gains["k2"]
    a = np.array([[0.0, 1.0], [w2 * (1 - k1), -w2 * k2]])
    for locus in loci(12, **gains, **STILL, start="unsaturated", seed=2, duration=2.0):
        exact = np.stack([expm(a * t) @ [locus.x_true[0], locus.v_true[0]] for t in locus.time])
        np.testing.assert_allclose(locus.x_true, exact[:, 0], atol=1e-10)
        np.testing.assert_allclose(locus.v_true, exact[:, 1], atol=1e-9)


def _reference(locus: Locus, gains: dict[str, float], switch: float) -> np.ndarray:
    """Independent integration in two pieces, with the kink between them (times of the pieces from the locus)."""
    w2, k1, k2 = gains["omega"] ** 2, gains["k1"], gains["k2"]
    limit = 0.1 if locus.side == "right" else -0.1
    start, out = [locus.x_true[0], locus.v_true[0]], []
    pieces = ((0.0, switch, lambda t, s: [s[1], w2 * (s[0] - limit)]), (switch, locus.time[-1], None))
    for begin, end, law in pieces:
        slope = law or (lambda t, s: [s[1], w2 * (s[0] - k1 * s[0] - k2 * s[1])])
        at = locus.time[(locus.time >= begin) & (locus.time <= end)]
        run = solve_ivp(slope, (begin, end), start, rtol=1e-12, atol=1e-14, dense_output=True)
        out.append(run.sol(at)[0])
        start = run.y[:, -1]
    return np.concatenate(out)


def test_one_switch_out_of_saturation_is_followed() -> None:
    """A locus that leaves saturation once agrees with a piecewise integration through its switching time to 1e-6 m."""
    once = [x for x in loci(32, **NEAR, **STILL, seed=3, duration=1.0) if len(x.switches) == 1]
    assert len(once) >= 10
    for locus in once:
        assert abs(locus.p_true[0]) == 0.1
        np.testing.assert_allclose(locus.x_true, _reference(locus, NEAR, locus.switches[0]), atol=1e-6)


def test_switches_are_where_the_law_meets_a_limit() -> None:
    """Between frames at each switch the law's clipped ZMP leaves or enters the limit."""
    for locus in loci(16, **NEAR, **STILL, seed=4):
        at_limit = np.isclose(np.abs(locus.p_true), 0.1, atol=1e-12)
        changes = locus.time[np.flatnonzero(np.diff(at_limit))]
        assert len(changes) == len(locus.switches) > 0
        np.testing.assert_allclose(locus.switches, changes, atol=5e-3 + 1e-9)


def test_start_states_are_of_the_kind_asked_for() -> None:
    """Kinds differ by the extrapolated CoM and by the law; recoverable ones end near the reference, falling ones do not."""
    for kind in ("saturated", "unsaturated", "beyond", "falling"):
        for x in loci(40, **NEAR, start=kind, seed=5):
            side = 1.0 if x.side == "right" else -1.0
            xi = side * (x.x_true[0] + x.v_true[0] / NEAR["omega"])
            assert (xi > 0.1) == (kind == "falling")
            assert (side * x.x_true[0] > 0.1) == (kind == "beyond") or kind == "falling"
            if kind != "unsaturated":
                assert side * x.p_true[0] == pytest.approx(0.1)
            if kind == "falling":
                assert np.abs(x.x_true).max() <= 0.3
                assert side * x.x_true[-1] > 0.28
            else:
                assert abs(x.x_true[-1]) < 0.02
                assert x.time[-1] == pytest.approx(4.0)


def test_both_sides_and_a_shifted_reference() -> None:
    """Loci start on both sides of the reference and settle on it, also where it is off the middle of the limits."""
    all_loci = loci(60, **NEAR, **STILL, d=0.03, limits=(-0.08, 0.12), seed=6)
    assert 15 <= sum(x.side == "left" for x in all_loci) <= 45
    for x in all_loci:
        assert x.x_true[-1] == pytest.approx(0.03, abs=1e-3)
        assert x.p_true.min() >= -0.08
        assert x.p_true.max() <= 0.12


def test_sensor_noise_has_its_size() -> None:
    """Measured minus true is white with the stated standard deviations."""
    many = loci(40, **NEAR, marker_noise=1.5e-3, cop_noise=0.7e-3, seed=7)
    for got, size in (([x.x - x.x_true for x in many], 1.5e-3), ([x.p - x.p_true for x in many], 0.7e-3)):
        noise = np.concatenate(got)
        assert noise.std() == pytest.approx(size, rel=0.02)
        assert abs(np.mean(noise[1:] * noise[:-1])) < 0.02 * size**2


def test_feedback_noise_is_ornstein_uhlenbeck() -> None:
    """Wanted ZMP minus law has the stated sd and falls to 1/e of its correlation in the stated time."""
    many = loci(80, **NEAR, start="unsaturated", feedback_time=0.25, duration=8.0, seed=8)
    many = [x for x in many if len(x.switches) == 0]
    assert len(many) > 60
    noise = np.stack([x.p_true - NEAR["k1"] * x.x_true - NEAR["k2"] * x.v_true for x in many])
    assert noise.std() == pytest.approx(3e-3, rel=0.05)
    lag = 50  # [frames] of 5 ms
    assert (noise[:, lag:] * noise[:, :-lag]).mean() / noise.var() == pytest.approx(np.exp(-1), abs=0.05)


def test_delay_is_the_age_of_the_state_in_the_law() -> None:
    """The ZMP now is the clipped law of the CoM 80 ms ago."""
    for x in loci(10, omega=2.8, k1=2.5, k2=0.75, **STILL, delay=0.08, seed=9):
        law = np.clip(2.5 * x.x_true[:-16] + 0.75 * x.v_true[:-16], -0.1, 0.1)
        np.testing.assert_allclose(x.p_true[16:], law, atol=1e-6)


def test_momentum_gives_omega_back() -> None:
    """Change of velocity = omega^2 times the integral of x - p, with noise in the loop and none in the sensors."""
    top, bottom = [], []
    for x in loci(32, **FAR, rate=1000.0, seed=10):
        y = x.x_true - x.p_true
        bottom.append(np.trapezoid(y[:400], x.time[:400]))
        top.append(x.v_true[399] - x.v_true[0])
    assert np.sqrt(np.dot(top, bottom) / np.dot(bottom, bottom)) == pytest.approx(FAR["omega"], rel=1e-5)


def test_a_seed_gives_the_same_loci_and_another_others() -> None:
    """The seed alone decides."""
    a, b, c = (loci(3, **NEAR, seed=s) for s in (1, 1, 2))
    assert all(np.array_equal(x.x, y.x) and np.array_equal(x.p, y.p) for x, y in zip(a, b, strict=True))
    assert not np.array_equal(a[0].x, c[0].x)


def test_what_cannot_be_simulated_is_refused() -> None:
    """A delay below the step and a start that does not exist stop with the numbers in the message."""
    with pytest.raises(ValueError, match=r"0\.0004 s is shorter than the integration step"):
        loci(1, **NEAR, delay=4e-4, seed=1)
    with pytest.raises(ValueError, match="no saturated start state exists"):
        loci(4, omega=2.7, k1=0.1, k2=0.01, seed=1)
