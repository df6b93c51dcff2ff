"""How many clusters: one where there is one, two where there are two."""

import numpy as np
import pytest

from plumbline import mixture


def drawn(rng: np.random.Generator, centres: list[float], n: int, se: float, spread: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    sd = se * rng.uniform(0.5, 2.0, n)
    return rng.choice(centres, n) + spread * rng.standard_normal(n) + sd * rng.standard_normal(n), sd


@pytest.mark.parametrize("spread", [0.0, 0.05])
def test_one_cluster_wins_on_one_cluster(spread: float) -> None:
    """At most 2 of 60 studies with a single omega are split, also where loci differ by more than their errors."""
    rng = np.random.default_rng(11)
    split = sum(len(mixture.choose(*drawn(rng, [2.8], 64, 0.02, spread)).mixture.centre) > 1 for _ in range(60))
    assert split <= 2


def test_two_clusters_are_found_and_placed() -> None:
    """The published omegas of condition A: 20 of 20 studies of 64 loci give two, within 0.02 rad/s."""
    rng = np.random.default_rng(12)
    for _ in range(20):
        got = mixture.choose(*drawn(rng, [2.117, 2.740], 64, 0.02, 0.01)).mixture
        assert len(got.centre) == 2
        assert got.centre == pytest.approx([2.117, 2.740], abs=0.02)


def test_order_of_loci_does_not_matter() -> None:
    """A permuted list gives the same clusters."""
    value, se = drawn(np.random.default_rng(13), [2.1, 2.7], 40, 0.03)
    order = np.random.default_rng(1).permutation(40)
    a, b = mixture.choose(value, se), mixture.choose(value[order], se[order])
    np.testing.assert_allclose(a.mixture.centre, b.mixture.centre, rtol=1e-9)
    np.testing.assert_allclose(a.score, b.score, rtol=1e-9)


def test_few_loci_are_not_split() -> None:
    """Two loci, however far apart, are one cluster: there is nothing to leave out."""
    got = mixture.choose(np.array([2.0, 3.0]), np.array([0.01, 0.01]))
    assert len(got.mixture.centre) == 1


def test_no_locus_is_refused() -> None:
    """Nothing to cluster is an error and no empty answer."""
    with pytest.raises(ValueError, match="no estimate"):
        mixture.choose(np.array([]), np.array([]))
