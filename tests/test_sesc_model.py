"""The numerics of the statically equivalent serial chain."""

import numpy as np
import pytest

from plumbline.errors import PlumblineError
from plumbline.models import sesc
from plumbline.models.sesc import Bounds, Noise, Prior


def _case(seed: int, rows: int = 60, q: int = 9) -> tuple[Prior, sesc.Rows, np.ndarray]:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(q, q))
    prior = Prior(rng.normal(size=q), root @ root.T / q + 0.1 * np.eye(q))
    truth = rng.multivariate_normal(prior.mean, prior.covariance)
    matrix = rng.normal(size=(rows, q)) * np.geomspace(3.0, 0.01, q)
    return prior, sesc.Rows(matrix, matrix @ truth + rng.normal(size=rows)), truth


def test_the_recursion_ends_where_the_batch_does():
    """Without drift and with no constraint that binds, the paper's filter and the batch give the same numbers to 1e-9."""
    prior, rows, _ = _case(1)
    whole, state = sesc.batch(prior, rows), sesc.recursive(prior, rows)
    assert np.allclose(state.mean, whole.mean, rtol=0, atol=1e-9)
    assert np.allclose(state.covariance, whole.covariance, rtol=0, atol=1e-9)
    wide = Bounds(np.eye(9), np.full(9, -1e6), np.full(9, 1e6))
    assert np.allclose(sesc.recursive(prior, rows, bounds=wide).mean, whole.mean, rtol=0, atol=1e-9)


def test_the_batch_is_bayes_rule():
    """The textbook's form, with matrices inverted as they stand, gives the same mean and covariance."""
    prior, rows, _ = _case(2)
    information = np.linalg.inv(prior.covariance) + rows.matrix.T @ rows.matrix
    mean = np.linalg.solve(information, np.linalg.solve(prior.covariance, prior.mean) + rows.matrix.T @ rows.values)
    found = sesc.batch(prior, rows)
    assert np.allclose(found.covariance, np.linalg.inv(information), atol=1e-10)
    assert np.allclose(found.mean, mean, atol=1e-10)


def test_without_data_the_prior_is_left():
    """No rows, no opinion: mean, covariance and gains are the prior's."""
    prior, rows, _ = _case(3)
    found = sesc.batch(prior, sesc.Rows(rows.matrix[:0], rows.values[:0]))
    assert np.allclose(found.mean, prior.mean)
    assert np.allclose(found.covariance, prior.covariance)
    assert np.allclose(found.gains, 0.0)


def test_bands_cover_the_truth():
    """Over 300 people drawn from the prior, the 95 % bands of the parameters hold the truth 93 to 97 times in 100."""
    inside = []
    for seed in range(300):
        prior, rows, truth = _case(100 + seed)
        found = sesc.batch(prior, rows)
        inside.append(np.abs(found.mean - truth) < 1.96 * np.sqrt(np.diag(found.covariance)))
    assert 0.93 < np.mean(inside) < 0.97


def test_gains_say_how_much_of_a_direction_is_learnt():
    """Along a direction with gain s the posterior's variance is the prior's over 1 + s^2."""
    prior, rows, _ = _case(4)
    found = sesc.batch(prior, rows)
    back = np.linalg.inv(found.directions)  # coordinates in which the prior is white
    assert np.allclose(back @ prior.covariance @ back.T, np.eye(9), atol=1e-8)
    assert np.allclose(back @ found.covariance @ back.T, np.diag(1 / (1 + found.gains**2)), atol=1e-8)
    assert (np.diff(found.gains) <= 0).all()


def test_a_constraint_that_binds_is_met_and_nothing_else():
    """The filter ends on a bound that the data pull it over; the other bounds are left alone, and it is the nearest such state."""
    prior, rows, _ = _case(5)
    free = sesc.recursive(prior, rows)
    upper = np.full(9, 1e6)
    upper[2] = free.mean[2] - 0.5
    bounds = Bounds(np.eye(9), np.full(9, -1e6), upper)
    state = sesc.Kalman(free.mean.copy(), free.covariance.copy(), bounds=bounds)
    state.update(np.zeros(9), 0.0)
    assert state.bound == [2]
    assert state.mean[2] == pytest.approx(upper[2], abs=1e-12)
    # along the bound nothing is gained: the step is along the covariance's column
    step = state.mean - free.mean
    assert np.allclose(step, free.covariance[:, 2] * step[2] / free.covariance[2, 2], atol=1e-9)
    assert sesc.recursive(prior, rows, bounds=bounds).mean[2] <= upper[2] + 1e-12


def test_drift_forgets():
    """With drift the covariance is wider than without, and the last rows weigh more."""
    prior, rows, _ = _case(6)
    still, moving = sesc.recursive(prior, rows), sesc.recursive(prior, rows, drift=0.01 * np.eye(9))
    assert (np.diag(moving.covariance) > np.diag(still.covariance)).all()


def test_the_covariance_of_means_is_that_of_simulated_noise():
    """White and slow noise, averaged over windows of 0.5 s: variance and neighbours' covariance as simulated, to 5 %."""
    rng, rate, noise = np.random.default_rng(7), 50.0, Noise(white=0.003, slow=0.002, memory=0.8, floor=0.0)
    n, k = 25, 4
    keep = np.exp(-1.0 / rate / noise.memory)
    x = np.zeros((40000, n * k))
    x[:, 0] = noise.slow * rng.normal(size=len(x))
    for i in range(1, n * k):
        x[:, i] = keep * x[:, i - 1] + noise.slow * np.sqrt(1 - keep**2) * rng.normal(size=len(x))
    means = (x + noise.white * rng.normal(size=x.shape)).reshape(len(x), k, n).mean(axis=2)
    said = sesc.mean_covariance(0.5 * np.arange(k), 0.5, n, noise)
    assert np.allclose(np.cov(means.T), said, rtol=0.05, atol=2e-8)


def test_basis_of_a_chain():
    """B R is the sum of the segments' vectors, each turned with its segment (eq. 6); ties make parameters fewer."""
    rng = np.random.default_rng(8)
    rotations = np.linalg.qr(rng.normal(size=(5, 3, 3, 3)))[0]
    parameters = rng.normal(size=(3, 3))
    b = sesc.chain(rotations)
    by_hand = np.einsum("nsij,sj->ni", rotations, parameters)
    assert np.allclose(b @ parameters.ravel(), by_hand)
    ties = np.zeros((9, 2))
    ties[2, 0] = ties[5, 0] = ties[8, 1] = 1.0
    assert np.allclose(sesc.tied(b, ties) @ [2.0, 3.0], b @ (ties @ [2.0, 3.0]))


def test_a_prior_without_spread_is_refused():
    """A parameter that cannot vary is no parameter."""
    with pytest.raises(PlumblineError, match="no spread"):
        sesc.batch(Prior(np.zeros(2), np.diag([1.0, 0.0])), sesc.Rows(np.zeros((0, 2)), np.zeros(0)))


def test_a_window_given_twice_is_refused():
    """Two equal windows have no noise between them."""
    with pytest.raises(PlumblineError, match="given twice"):
        sesc.decorrelated(np.ones((2, 1)), np.ones(2), np.ones((2, 2)))
