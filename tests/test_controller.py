"""The law of the paper against its own equations."""

import numpy as np
import pytest

from plumbline.models.controller import Law, damping, gains, poles


def test_poles_and_gains_are_inverse() -> None:
    """Equation 7 both ways, for real and for complex q."""
    for q1, q2 in ((1.0, 2.5), (0.8 + 0.7j, 0.8 - 0.7j)):
        k1, k2 = gains(q1, q2, 2.9)
        assert np.sort_complex(poles(k1, k2, 2.9)) == pytest.approx(np.sort_complex([q1, q2]))


@pytest.mark.parametrize(("k1", "k2", "omega", "zeta"), [(4.038, 0.875, 2.740, 0.69), (2.204, 0.549, 2.914, 0.73)])
def test_both_published_sets_are_underdamped(k1: float, k2: float, omega: float, zeta: float) -> None:
    """The published gains give a conjugate pair, with the damping that follows from it."""
    q1, q2 = poles(k1, k2, omega)
    assert q1.imag > 0
    assert q2 == q1.conjugate()
    assert damping(k1, k2, omega) == pytest.approx(zeta, abs=0.005)


def test_closed_loop_decays_with_the_poles() -> None:
    """x = exp(-w q t) solves x'' = w2 (x - p) with p from the law, for each pole."""
    k1, k2, w = 4.038, 0.875, 2.740
    for q in poles(k1, k2, w):
        s = -w * q
        assert abs(s**2 - w**2 * (1 - (k1 + k2 * s))) < 1e-12 * w**2


def test_half_a_pair_is_refused() -> None:
    """One complex q alone makes complex gains."""
    with pytest.raises(ValueError, match="conjugate"):
        gains(1 + 1j, 2.0, 2.9)


def test_a_law_that_does_not_return_has_no_damping() -> None:
    """k1 below 1 pushes the CoM away."""
    assert np.isnan(damping(0.9, 0.5, 2.9))


def test_the_law_is_clipped_and_says_where() -> None:
    """Region and ZMP agree with each other."""
    law = Law(0.01, 4.0, 0.9, -0.1, 0.12)
    x, v = np.array([-0.2, 0.01, 0.2]), np.zeros(3)
    assert law.region(x, v).tolist() == [-1, 0, 1]
    assert law.zmp(x, v) == pytest.approx([-0.1, 0.01, 0.12])
