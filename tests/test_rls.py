"""Returning RLS: against exact least squares, against the classical loop, and what no estimator may change."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from plumbline import filters, rls
from plumbline.errors import PlumblineError
from plumbline.simulate import pendulum

Array = NDArray[np.float64]
PUBLISHED: tuple[dict[str, Any], ...] = ({"omega": 2.740, "k1": 4.038, "k2": 0.875}, {"omega": 2.914, "k1": 2.204, "k2": 0.549})


# -- references -------------------------------------------------------------------------------------------------------


def whole(a: Array) -> tuple[NDArray[np.object_], Fraction]:
    """Floats as integers of any size times one power of two: sums and products of them are exact."""
    ratios = [v.as_integer_ratio() for v in a.tolist()]
    common = max(2**40, *(d for _, d in ratios))
    return np.array([n * (common // d) for n, d in ratios], dtype=object), Fraction(1, common)


def exact(y: Array, phi: list[Array], prior: float = 0.0, forgetting: float = 1.0) -> Array:
    """Least squares of one locus after each frame by integers, rounded once; prior: 1/P0.  Shape (c, n), NaN where singular."""
    c, n = len(phi), len(y)
    top, bottom = forgetting.as_integer_ratio()
    columns, units = zip(*(whole(f) for f in phi), strict=True)
    right, unit_y = whole(y)
    held = [int(Fraction(prior) / u**2) if prior else 0 for u in units]
    assert all(Fraction(h) * u**2 == Fraction(prior) for h, u in zip(held, units, strict=True))
    s = np.array([[held[i] if i == j else 0 for j in range(c)] for i in range(c)], dtype=object)
    b = np.array([0] * c, dtype=object)
    out = np.full((c, n), np.nan)
    for k in range(n):
        f = np.array([col[k] for col in columns], dtype=object)
        s = s * top + np.outer(f, f) * bottom ** (k + 1)  # bottom^(k + 1) S_k
        b = b * top + f * (right[k] * bottom ** (k + 1))
        for i, value in enumerate(cramer(s, b)):
            out[i, k] = np.nan if value is None else value * unit_y / units[i]
    return out


def cramer(s: NDArray[np.object_], b: NDArray[np.object_]) -> list[Fraction | None]:
    """Solution of an integer system by determinants; None where it is singular."""
    whole_det = determinant(s)
    if whole_det == 0:
        return [None] * len(b)
    out: list[Fraction | None] = []
    for i in range(len(b)):
        swapped = s.copy()
        swapped[:, i] = b
        out.append(Fraction(determinant(swapped), whole_det))
    return out


def determinant(a: NDArray[np.object_]) -> int:
    """By the first row."""
    if len(a) == 1:
        return int(a[0, 0])
    return sum((-1) ** j * int(a[0, j]) * determinant(np.delete(a[1:], j, axis=1)) for j in range(len(a)))


def loop(y: Array, phi: list[Array], forgetting: float, p0: float, *, shared: bool) -> Array:
    """The classical loop for one locus: gain g = P phi/(lambda + phi'P phi), then P - g (phi'P), or, shared, P - g (P phi)'."""
    rows, theta, p = np.array(phi).T, np.zeros(len(phi)), p0 * np.eye(len(phi))
    out = np.empty((len(phi), len(y)))
    with np.errstate(all="ignore"):
        for k, f in enumerate(rows):
            reach = p @ f
            gain = reach / (forgetting + f @ reach)
            theta = theta + gain * (y[k] - f @ theta)
            p = (p - np.outer(gain, reach if shared else f @ p)) / forgetting
            out[:, k] = theta
    return out


def condition(information: Array, c: int) -> Array:
    """cond(S_k) of one locus, (n,)."""
    s = np.empty((information.shape[1], c, c))
    for entry, (i, j) in zip(information, zip(*np.triu_indices(c), strict=True), strict=True):
        s[:, i, j] = s[:, j, i] = entry
    with np.errstate(all="ignore"):
        return np.asarray(np.linalg.cond(s))


def excess(got: Array, wanted: Array, information: Array, y: Array, phi: list[Array]) -> Array:
    """Error over 1e-15 cond(S_k) |theta|, for the frames at which both know theta.

    Where theta passes through zero, no double can hold the sum of phi y to its own relative precision; there |theta| stands for the
    size that the data give it, |y|/|phi|.
    """
    size = np.sqrt(np.cumsum(y**2) / sum(np.cumsum(f**2) for f in phi))
    scale = np.maximum(np.linalg.norm(wanted, axis=0), size)
    known = np.isfinite(got).all(axis=0) & np.isfinite(wanted).all(axis=0)
    return np.asarray((np.linalg.norm(got - wanted, axis=0) / scale / condition(information, len(phi)) / 1e-15)[known])


def motion(parameters: dict[str, Any], start: pendulum.Start, seed: int, n: int = 4) -> tuple[Array, Array, Array, Array]:
    """x, x', x'' (low-passed at 6 Hz) and p of some loci, each (frames, n)."""
    loci = pendulum.loci(n, start=start, seed=seed, duration=3.0, **parameters)
    frames = min(len(one.x) for one in loci)
    time = loci[0].time[:frames]
    x = filters.low_pass(np.column_stack([one.x[:frames] for one in loci]), time, 6.0)
    v, a = filters.derivatives(x, time)
    return x, v, a, np.column_stack([one.p[:frames] for one in loci])


def random(c: int, n: int, m: int, seed: int, offset: float = 0.0) -> tuple[Array, list[Array]]:
    """y and regressors with theta = 1, 2, 3."""
    rng = np.random.default_rng(seed)
    phi = [rng.normal(offset, 1.0, (n, m)) for _ in range(c)]
    return np.asarray(sum((i + 1.0) * f for i, f in enumerate(phi)) + rng.normal(0, 0.3, (n, m))), phi


# -- accuracy ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("offset", [0.0, 3.0])
def test_random_data_are_solved_to_the_rounding_of_their_condition(c: int, offset: float) -> None:
    """Within 1e-15 cond(S_k) |theta| of exact least squares at every frame, forward (seed 5)."""
    y, phi = random(c, 500, 2, seed=5, offset=offset)
    trace = rls.forward(y, phi)
    for i in range(2):
        wanted = exact(y[:, i], [f[:, i] for f in phi])
        got = trace.theta[:, :, i]
        assert np.isfinite(got[:, c:]).all()
        known = np.isfinite(got).all(axis=0) & np.isfinite(wanted).all(axis=0)
        error = np.linalg.norm(got - wanted, axis=0) / np.linalg.norm(wanted, axis=0)
        assert np.all((error / condition(trace.information[:, :, i], c))[known] <= 1e-15)


@pytest.mark.parametrize("parameters", PUBLISHED)
@pytest.mark.parametrize("start", ["saturated", "unsaturated", "falling"])
def test_loci_are_solved_to_the_rounding_of_their_condition(parameters: dict[str, Any], start: pendulum.Start) -> None:
    """The same on simulated loci, forward and back, for omega^2 and for the law with and without a free reference (seed 11)."""
    x, v, a, p = motion(parameters, start, seed=11, n=2)
    one = np.ones_like(x)
    for y, phi in ((a, [x - p]), (p, [x, v]), (p, [one, x, v])):
        there, back = rls.returning(y, phi)
        for i in range(2):
            locus, columns = y[:, i], [f[:, i] for f in phi]
            wanted = exact(locus, columns)
            assert excess(there.theta[:, :, i], wanted, there.information[:, :, i], locus, columns).max() <= 1.0
            turned = [f[::-1] for f in columns]
            wanted = exact(locus[::-1], turned)
            got, information = back.theta[:, ::-1, i], back.information[:, ::-1, i]
            assert excess(got, wanted, information, locus[::-1], turned).max() <= 1.0


@pytest.mark.parametrize("kind", ["random", "constant"])
def test_rounding_does_not_grow_with_the_frames(kind: str) -> None:
    """20,000 frames of noise, or of one number whose roundings all point the same way: still within 1e-15 (seed 6)."""
    n = 20_000
    y, (phi,) = random(1, n, 1, seed=6, offset=1.0) if kind == "random" else (np.full((n, 1), 0.3), [np.full((n, 1), 0.1)])
    got = rls.forward(y, [phi]).theta[0, :, 0]
    (f, unit_f), (g, unit_g) = whole(phi[:, 0]), whole(y[:, 0])
    top, bottom = np.cumsum(f * g), np.cumsum(f * f)
    wanted = np.array([float(Fraction(a, b) * unit_g / unit_f) for a, b in zip(top, bottom, strict=True)])
    assert np.max(np.abs(got / wanted - 1)) <= 1e-15


@pytest.mark.parametrize("c", [1, 2, 3])
def test_the_prior_is_held_exactly_and_forgotten(c: int) -> None:
    """With P0 = 4 and lambda = 31/32, within 1e-15 cond(S_k) of the exact regularised minimum from the first frame (seed 7)."""
    y, phi = random(c, 300, 1, seed=7)
    trace = rls.forward(y, phi, forgetting=31 / 32, p0=4.0)
    columns = [f[:, 0] for f in phi]
    wanted = exact(y[:, 0], columns, prior=0.25, forgetting=31 / 32)
    assert np.isfinite(trace.theta).all()
    assert excess(trace.theta[:, :, 0], wanted, trace.information[:, :, 0], y[:, 0], columns).max() <= 1.0


@pytest.mark.parametrize("p0", [1.0, 1e2, 1e4])
def test_without_forgetting_the_classical_loop_agrees(p0: float) -> None:
    """To 1e-10 of |theta| at every frame, on loci (omega^2; law with 2 and 3 parameters) and random data (seeds 12, 13)."""
    x, v, a, p = motion(PUBLISHED[0], "saturated", seed=12)
    for y, phi in ((a, [x - p]), (p, [x, v]), (p, [np.ones_like(x), x, v]), random(3, 400, 4, seed=13)):
        got = rls.forward(y, phi, p0=p0).theta
        for i in range(4):
            wanted = loop(y[:, i], [f[:, i] for f in phi], 1.0, p0, shared=False)
            assert np.all(np.linalg.norm(got[:, :, i] - wanted, axis=0) <= 1e-10 * np.linalg.norm(wanted, axis=0))


def pausing(n: int, seed: int) -> tuple[Array, list[Array]]:
    """A law p = 0.3 + 0.8 x of somebody who moves, stands still from n/5 to 7 n/10, and moves again."""
    rng = np.random.default_rng(seed)
    x = rng.normal(0.1, 0.05, n)
    x[n // 5 : 7 * n // 10] = 0.1
    return 0.3 + 0.8 * x + rng.normal(0, 1e-3, n), [np.ones(n), x]


def test_with_forgetting_the_classical_loop_drifts_and_this_stays() -> None:
    """With lambda = 31/32 the loop that shares P phi leaves exact least squares by > 1e-6, exciting data and all (seed 8).

    Its P loses its symmetry: that part of the rounding grows by 1/lambda a frame. The prefix sums stay within 1e-15 cond(S_k).
    """
    y, phi = random(2, 1000, 1, seed=8)
    columns = [f[:, 0] for f in phi]
    wanted = exact(y[:, 0], columns, prior=2.0**-13, forgetting=31 / 32)
    trace = rls.forward(y, phi, forgetting=31 / 32, p0=2.0**13)
    assert excess(trace.theta[:, :, 0], wanted, trace.information[:, :, 0], y[:, 0], columns).max() <= 1.0
    size = np.linalg.norm(wanted[:, -1])
    assert np.linalg.norm(loop(y[:, 0], columns, 31 / 32, 2.0**13, shared=True)[:, -1] - wanted[:, -1]) > 1e-6 * size
    assert np.linalg.norm(loop(y[:, 0], columns, 31 / 32, 2.0**13, shared=False)[:, -1] - wanted[:, -1]) < 1e-12 * size


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_after_a_pause_the_classical_loop_is_lost_and_this_is_not(seed: int) -> None:
    """Regressors stand still for 600 frames at lambda = 15/16: either form of the loop ends the pause with made-up parameters.

    Here theta is NaN while nothing tells the parameters apart. Ten frames into the next motion it is within 1e-15 cond(S_k) of exact
    least squares; both loops are off by > 1e-5.
    """
    y, phi = pausing(1200, seed)
    wanted = exact(y, phi, prior=2.0**-13, forgetting=15 / 16)
    trace = rls.forward(y[:, None], [f[:, None] for f in phi], forgetting=15 / 16, p0=2.0**13)
    assert excess(trace.theta[:, :, 0], wanted, trace.information[:, :, 0], y, phi).max() <= 1.0
    assert np.isnan(trace.theta[:, 839, 0]).all()
    assert np.isfinite(trace.theta[:, 850:, 0]).all()
    for shared in (True, False):
        error = np.abs(loop(y, phi, 15 / 16, 2.0**13, shared=shared) - wanted).max(axis=0)
        assert error[839] > 1e-4
        assert error[850] > 1e-5


# -- the returning pass -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("reset", [1e3, 1e6, np.inf])
def test_the_way_back_ends_where_the_way_there_ended(reset: float) -> None:
    """For lambda = 1, theta_B[0] = theta_F[N], whatever P0 is reset to: both have seen every frame (seed 14)."""
    x, v, _, p = motion(PUBLISHED[0], "unsaturated", seed=14)
    there, back = rls.returning(p, [x, v], reset=reset)
    np.testing.assert_allclose(back.theta[:, 0], there.theta[:, -1], rtol=1e-12)


def test_the_way_back_starts_at_the_last_estimate() -> None:
    """With a prior far heavier than the last frame, theta_B[N] is theta_F[N]; with an infinite P0, c frames are waited for."""
    y, phi = random(2, 100, 3, seed=15)
    there, back = rls.returning(y, phi, reset=1e-12)
    np.testing.assert_allclose(back.theta[:, -1], there.theta[:, -1], rtol=1e-9)
    _, back = rls.returning(y, phi)
    assert np.isnan(back.theta[:, -1]).all()
    assert np.isfinite(back.theta[:, :-1]).all()


def test_back_is_forth_of_the_time_reversed_locus() -> None:
    """The backward pass is the forward pass of the mirrored record, bit by bit (seed 16)."""
    y, phi = random(3, 333, 5, seed=16)
    back = rls.backward(y, phi, forgetting=0.97, p0=10.0, theta0=[1.0, 0.0, -1.0])
    there = rls.forward(y[::-1], [f[::-1] for f in phi], forgetting=0.97, p0=10.0, theta0=[1.0, 0.0, -1.0])
    assert np.array_equal(back.theta, there.theta[:, ::-1])
    assert np.array_equal(back.information, there.information[:, ::-1])


def test_both_ways_find_the_law_and_going_back_strays_at_the_switch() -> None:
    """Without noise the backward estimate is (k1, k2) to 1e-6 back to the last switch, and off by > 1 % at the start (seed 17)."""
    quiet: dict[str, Any] = {"marker_noise": 0.0, "cop_noise": 0.0, "feedback_sd": 0.0}
    for one in pendulum.loci(6, start="saturated", seed=17, **PUBLISHED[0], **quiet):
        assert len(one.switches)
        _, back = rls.returning(one.p_true[:, None], [one.x_true[:, None], one.v_true[:, None]])
        free = (one.time > one.switches[-1]) & (one.time < one.switches[-1] + 1.0)
        np.testing.assert_allclose(back.theta[:, free, 0], np.array([[4.038], [0.875]]) * np.ones(free.sum()), rtol=1e-6)
        assert np.abs(back.theta[:, 0, 0] / [4.038, 0.875] - 1).max() > 0.01


def test_forward_finds_omega_squared() -> None:
    """The plant of a simulated fall, x'' = w2 (x - p), gives w2 from its first moving frame (seed 18)."""
    for one in pendulum.loci(4, start="falling", seed=18, **PUBLISHED[1]):
        lever = one.x_true - one.p_true
        trace = rls.forward(2.914**2 * lever[:, None], [lever[:, None]])
        np.testing.assert_allclose(trace.theta[0, :, 0], 2.914**2, rtol=1e-14)


# -- what changes nothing, and what changes with the data ---------------------------------------------------------------


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    c=st.integers(1, 3),
    n=st.integers(3, 200),
    m=st.integers(1, 5),
    forgetting=st.sampled_from([1.0, 0.98, 0.6]),
    p0=st.sampled_from([np.inf, 50.0]),
    seed=st.integers(0, 999),
)
def test_scale_order_and_mirror(c: int, n: int, m: int, forgetting: float, p0: float, seed: int) -> None:
    """y times 8: theta times 8. Loci in another order: the same loci. phi, y -> -phi, -y: the same theta. All bit by bit."""
    y, phi = random(c, n, m, seed)
    want: dict[str, Any] = {"forgetting": forgetting, "p0": p0}
    for run in (rls.forward, rls.backward):
        base = run(y, phi, **want)
        assert np.array_equal(run(8 * y, phi, **want).theta, 8 * base.theta, equal_nan=True)
        mirrored = run(-y, [-f for f in phi], **want)
        assert np.array_equal(mirrored.theta, base.theta, equal_nan=True)
        order = np.random.default_rng(seed).permutation(m)
        shuffled = run(y[:, order], [f[:, order] for f in phi], **want)
        assert np.array_equal(shuffled.theta, base.theta[:, :, order], equal_nan=True)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    c=st.integers(1, 3),
    lengths=st.lists(st.integers(4, 150), min_size=1, max_size=5),
    extra=st.integers(0, 100),
    forgetting=st.sampled_from([1.0, 0.95]),
    p0=st.sampled_from([np.inf, 20.0]),
    seed=st.integers(0, 999),
)
def test_padding_counts_nothing(c: int, lengths: list[int], extra: int, forgetting: float, p0: float, seed: int) -> None:
    """Loci padded with NaN to one length give what each gives alone; behind its end a locus keeps its last value."""
    n, m = max(lengths) + extra, len(lengths)
    y, phi = random(c, n, m, seed)
    for i, k in enumerate(lengths):
        for column in (y, *phi):
            column[k:, i] = np.nan
    together = rls.returning(y, phi, forgetting=forgetting, p0=p0, reset=30.0, length=lengths)
    for i, k in enumerate(lengths):
        one = slice(i, i + 1)
        alone = rls.returning(y[:k, one], [f[:k, one] for f in phi], forgetting=forgetting, p0=p0, reset=30.0)
        for got, wanted in zip(together, alone, strict=True):
            np.testing.assert_allclose(got.theta[:, :k, one], wanted.theta, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(got.information[:, :k, one], wanted.information, rtol=1e-12, atol=1e-12)
        assert np.array_equal(together[0].theta[:, k:, i], np.repeat(together[0].theta[:, k - 1 : k, i], n - k, 1), equal_nan=True)
        assert np.all(together[0].information[:, k:, i] == together[0].information[:, k - 1 : k, i])
        assert np.isnan(together[1].theta[:, k:, i]).all()


@pytest.mark.parametrize("forgetting", [1.0, 0.9])
def test_blocks_leave_no_seam(forgetting: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks of 32 frames and 3 loci give what one block gives (seed 19)."""
    y, phi = random(2, 500, 10, seed=19)
    wanted = rls.forward(y, phi, forgetting=forgetting, p0=5.0)
    monkeypatch.setattr(rls, "CELLS", 100)
    monkeypatch.setattr(rls, "WIDTH", 3)
    got = rls.forward(y, phi, forgetting=forgetting, p0=5.0)
    np.testing.assert_allclose(got.theta, wanted.theta, rtol=1e-12)
    np.testing.assert_allclose(got.information, wanted.information, rtol=1e-13, atol=1e-13)


def test_fast_forgetting_does_not_overflow() -> None:
    """lambda = 1e-3 over 5,000 frames: finite, and the last frames decide (seed 20)."""
    y, phi = random(1, 5000, 2, seed=20)
    got = rls.forward(y, phi, forgetting=1e-3).theta
    assert np.isfinite(got).all()
    last = sum(1e-3**i * phi[0][-1 - i] * y[-1 - i] for i in range(6)) / sum(1e-3**i * phi[0][-1 - i] ** 2 for i in range(6))
    np.testing.assert_allclose(got[0, -1], last, rtol=1e-12)


def test_caller_and_library_keep_their_state() -> None:
    """Neither the arguments nor numpy's error and buffer settings change, and an earlier trace survives later calls."""
    y, phi = random(2, 64, 3, seed=21)
    y.flags.writeable = False
    for f in phi:
        f.flags.writeable = False
    before = np.geterr(), np.getbufsize()
    first = rls.forward(y, phi)
    kept = first.theta.copy()
    rls.forward(y * 2, phi, forgetting=0.5)
    assert np.array_equal(first.theta, kept, equal_nan=True)
    assert before == (np.geterr(), np.getbufsize())


# -- certificates -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("c", [1, 2, 3])
def test_deviation_is_the_scatter_of_repeated_experiments(c: int) -> None:
    """Over 4,000 draws of the noise of y, theta scatters by `deviation` within 5 % at every tenth frame (seed 22)."""
    rng = np.random.default_rng(22)
    n, m = 41, 4000
    phi = [np.repeat(rng.normal(1.0, 1.0, (n, 1)), m, axis=1) for _ in range(c)]
    y = sum(phi) + rng.normal(0, 0.2, (n, m))
    trace = rls.forward(np.asarray(y), phi)
    told = rls.deviation(trace, 0.2)
    assert np.isnan(told[:, : c - 1]).all()
    np.testing.assert_allclose(trace.theta[:, 10::10].std(axis=2), told[:, 10::10, 0], rtol=0.05)


def test_information_is_s_in_the_stated_order() -> None:
    """Rows 11, 12, 13, 22, 23, 33 of the sum of phi phi', with the prior on its diagonal."""
    y, phi = random(3, 50, 2, seed=23)
    information = rls.forward(y, phi, p0=[1.0, 2.0, 4.0]).information
    x = np.stack([f[:, 1] for f in phi])
    s = x @ x.T + np.diag([1.0, 0.5, 0.25])
    np.testing.assert_allclose(information[:, -1, 1], s[np.triu_indices(3)], rtol=1e-13)


def test_nothing_is_said_before_the_parameters_can_be_told_apart() -> None:
    """Fewer than c frames, collinear regressors or none at all: NaN; a prior speaks from the first frame on."""
    y, phi = random(3, 20, 2, seed=24)
    theta = rls.forward(y, phi).theta
    assert np.isnan(theta[:, :2]).all()
    assert np.isfinite(theta[:, 2:]).all()
    assert np.isnan(rls.forward(y, [phi[0], 3 * phi[0]]).theta).all()
    assert np.isnan(rls.forward(y, [np.zeros_like(y)]).theta).all()
    held = rls.forward(y, [np.zeros_like(y)], p0=1.0, theta0=7.0)
    assert np.all(held.theta == 7.0)
    assert np.all(rls.deviation(held, 0.5) == 0.5)


def test_what_does_not_fit_is_refused() -> None:
    """Shapes, lambda, P0 and lengths out of range, and samples that are not finite, are told with their values."""
    y, phi = random(2, 30, 300, seed=25)
    with pytest.raises(ValueError, match=r"share one shape.*\(30, 300\).*\(29, 300\)"):
        rls.forward(y, [phi[0], phi[1][1:]])
    with pytest.raises(ValueError, match=r"\(0, 1\].*1\.5"):
        rls.forward(y, phi, forgetting=1.5)
    with pytest.raises(ValueError, match="positive"):
        rls.forward(y, phi, p0=0.0)
    with pytest.raises(ValueError, match=r"1\.\.30, not 0\.\.30"):
        rls.forward(y, phi, length=np.r_[np.full(299, 30), 0])
    y[3, 217] = np.nan
    for run in (rls.forward, rls.backward):
        with pytest.raises(PlumblineError, match="locus 217 "):
            run(y, phi)
