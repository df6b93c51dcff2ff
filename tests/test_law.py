"""Switches, gains, limits and delay against the closed loop that made the loci."""

import numpy as np
import pytest
from made_loci import PUBLISHED, batched, made, switch_errors

from plumbline import law as laws

LIMITS = [(-0.1, 0.1), (-0.09, 0.13)]


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("name", ["A", "B"])
def test_switches_are_found_without_hands(name: str, limits: tuple[float, float]) -> None:
    """Median error at most 5 ms, nine of ten within 15 ms, none missed, at most 2 % too many; both published sets."""
    errors: list[float] = []
    missed = more = 0
    for seed in (1, 2, 3):
        loci = made(name, seed, limits=limits)
        b = batched(loci, PUBLISHED[name]["omega"])
        found = laws.regimes(b, PUBLISHED[name]["omega"], np.ones(len(loci), bool))
        assert found is not None
        e, m, x = switch_errors(loci, found.regime, b.lead, limits)
        errors, missed, more = [*errors, *e], missed + m, more + x
    assert np.median(np.abs(errors)) <= 5e-3
    assert np.percentile(np.abs(errors), 90) <= 15e-3
    assert abs(np.mean(errors)) < 2e-3
    assert missed == 0
    assert more <= 0.02 * len(errors)


@pytest.mark.parametrize(("name", "limits", "d"), [("A", (-0.09, 0.13), 0.012), ("B", (-0.14, 0.1), -0.01)])
def test_gains_limits_and_reference(name: str, limits: tuple[float, float], d: float) -> None:
    """Mean of four studies: gains within 1 % (3 mm of feedback noise), limits 0.2 mm, reference 0.5 mm; least squares is worse."""
    truth = np.array([PUBLISHED[name]["k1"], PUBLISHED[name]["k2"]])
    by_method: dict[str, list[np.ndarray]] = {"output error": [], "instruments": [], "saturation": []}
    for seed in range(4):
        loci = made(name, seed, limits=limits, d=d)
        b, omega, all_of_them = batched(loci, PUBLISHED[name]["omega"]), PUBLISHED[name]["omega"], np.ones(len(loci), bool)
        found = laws.regimes(b, omega, all_of_them)
        assert found is not None
        got = laws.identify(b, found.regime, omega, all_of_them)
        assert got is not None
        assert got.instruments is not None
        law = got.output_error.law
        assert (law.left, law.right) == pytest.approx(limits, abs=0.2e-3)
        assert law.d == pytest.approx(d, abs=1e-3)
        assert not got.late
        for key, one in zip(by_method, (law, got.instruments.law, got.saturation.law), strict=True):
            by_method[key].append(np.array([one.k1, one.k2]) / truth - 1)
    bias = {key: np.mean(values, axis=0) for key, values in by_method.items()}
    assert np.max(np.abs(bias["output error"])) < 0.01
    assert np.max(np.abs(bias["instruments"])) < 0.01
    assert np.min(bias["saturation"]) < -0.02


def test_ten_millimetres_of_feedback_noise() -> None:
    """Least squares loses a fifth of k1; output error and instruments stay within 3 % in the mean of five studies."""
    errors = []
    for seed in range(5):
        loci = made("A", seed, feedback_sd=10e-3)
        b, steady = batched(loci, 2.740), np.ones(len(loci), bool)
        found = laws.regimes(b, 2.740, steady)
        assert found is not None
        got = laws.identify(b, found.regime, 2.740, steady)
        assert got is not None
        assert got.instruments is not None
        errors.append([one.law.k1 / 4.038 - 1 for one in (got.saturation, got.output_error, got.instruments)])
    least, output, instruments = np.mean(errors, axis=0)
    assert least < -0.12
    assert abs(output) < 0.03
    assert abs(instruments) < 0.03


@pytest.mark.parametrize(("name", "delay"), [("A", 0.06), ("B", 0.1)])
def test_a_neural_delay_is_found(name: str, delay: float) -> None:
    """Median of three studies: within 10 ms; k1 is off by more than 15 % without the delay and by less than 5 % with it."""
    errors, late = [], []
    for seed in (5, 6, 7):
        loci = made(name, seed, delay=delay)
        b, omega, steady = batched(loci, PUBLISHED[name]["omega"]), PUBLISHED[name]["omega"], np.ones(len(loci), bool)
        found = laws.regimes(b, omega, steady)
        assert found is not None
        got = laws.identify(b, found.regime, omega, steady)
        assert got is not None
        assert got.late
        assert got.delayed is not None
        late.append(got.delayed.law.delay)
        errors.append([law.k1 / PUBLISHED[name]["k1"] - 1 for law in (got.output_error.law, got.delayed.law)])
    without, with_it = np.median(errors, axis=0)
    assert np.median(late) == pytest.approx(delay, abs=0.01)
    assert abs(without) > 0.15
    assert abs(with_it) < 0.05


def test_mirrored_loci_give_a_mirrored_law() -> None:
    """x -> -x, p -> -p: same gains, d and limits change sign and side, regimes change sign."""
    loci = made("B", 7, n=12, limits=(-0.09, 0.12), d=0.01)
    b = batched(loci, 2.914)
    mirrored = type(b)(b.rate, b.lead, b.end, -b.x, -b.v, -b.p)
    steady = np.ones(len(loci), bool)
    a, m = laws.regimes(b, 2.914, steady), laws.regimes(mirrored, 2.914, steady)
    assert a is not None
    assert m is not None
    np.testing.assert_array_equal(m.regime, -a.regime)
    np.testing.assert_allclose(m.law[:5], [-a.law.d, a.law.k1, a.law.k2, -a.law.right, -a.law.left], rtol=1e-4, atol=1e-5)


def test_a_limit_never_reached_is_none() -> None:
    """Loci that stay inside wide limits: no regime but inside, both limits infinite, gains still found."""
    loci = made("A", 4, starts=("unsaturated",), limits=(-0.3, 0.3), n=32)
    loci = [one for one in loci if np.abs(one.p_true).max() < 0.25]
    b, steady = batched(loci, 2.740), np.ones(len(loci), bool)
    found = laws.regimes(b, 2.740, steady)
    assert found is not None
    assert np.all(found.regime == 0)
    assert (found.law.left, found.law.right) == (-np.inf, np.inf)
    assert found.law.k1 == pytest.approx(4.038, rel=0.03)


def test_a_motion_without_excitation_gives_no_law() -> None:
    """Two frames of x and x' in a line cannot tell two gains."""
    loci = made("A", 4, n=2)
    b = batched(loci, 2.740)
    flat = type(b)(b.rate, b.lead, b.end, np.zeros_like(b.x), np.zeros_like(b.v), b.p)
    assert laws.regimes(flat, 2.740, np.ones(len(loci), bool)) is None
