"""CoM and velocity that the estimators see, against the simulated truth."""

import numpy as np
from made_loci import PUBLISHED, RATE, batched, made

from plumbline import batch


def test_velocity_is_right_up_to_both_ends() -> None:
    """1 mm of noise on marker and CoP leaves less than 0.5 mm and 3 mm/s, over a switch and at the ends too."""
    loci = made("A", 3)
    b = batched(loci, PUBLISHED["A"]["omega"])
    for j, one in enumerate(loci):
        rows = slice(b.lead, int(b.end[j]))
        assert np.sqrt(np.mean((b.x[rows, j] - one.x_true) ** 2)) < 0.5e-3
        assert np.sqrt(np.mean((b.v[rows, j] - one.v_true) ** 2)) < 3e-3


def test_a_wrong_omega_hardly_matters() -> None:
    """5 % of omega moves the velocity by less than 5 mm/s: the measured CoM holds it."""
    one = made("A", 3, n=1)[0]
    right, wrong = (batch.smoothed(one.x, one.p, 2.740 * s, RATE)[1] for s in (1.0, 1.05))
    assert np.sqrt(np.mean((right - wrong) ** 2)) < 5e-3


def test_the_past_is_uniform_where_it_is_not_known() -> None:
    """Without frames before a locus the CoM moves on a line with the first velocity."""
    b = batched(made("B", 1, n=2), 2.914)
    step = np.diff(b.x[: b.lead + 1], axis=0) * RATE
    np.testing.assert_allclose(step, b.v[b.lead] * np.ones_like(step), atol=1e-9)


def test_a_known_past_is_used() -> None:
    """Measured motion before a locus stands in the rows before it."""
    one = made("B", 1, n=1)[0]
    past = (np.linspace(0.0, 0.1, 30), np.full(30, 0.5))
    b = batch.of_loci([one.x], [one.p], 2.914, RATE, [past])
    np.testing.assert_array_equal(b.x[b.lead - 30 : b.lead, 0], past[0])
    np.testing.assert_array_equal(b.v[: b.lead, 0], np.full(b.lead, 0.5))


def test_thinning_keeps_the_first_frame() -> None:
    """A slower batch begins at the same instant and holds each second frame."""
    b = batched(made("A", 2, n=3), 2.740)
    half = b.thinned(100.0)
    assert half.rate == 100.0
    np.testing.assert_array_equal(half.x[half.lead], b.x[b.lead])
    np.testing.assert_array_equal(half.v[half.lead : half.lead + 5], b.v[b.lead : b.lead + 10 : 2])
    assert (half.end - half.lead).tolist() == [(e - b.lead + 1) // 2 for e in b.end]


def test_late_shifts_the_motion_and_not_the_zmp() -> None:
    """The state a law saw 50 ms ago beside today's ZMP."""
    b = batched(made("A", 2, n=2), 2.740)
    late = b.late(0.05)
    np.testing.assert_array_equal(late.x[b.lead :], b.x[b.lead - 10 : -10])
    np.testing.assert_array_equal(late.p, b.p)
