"""The closed loop beside the measured motion, and the terms that effects put into it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_loci import PUBLISHED, RATE, made

from plumbline import batch, law
from plumbline.effects import catalogue
from plumbline.effects.lag import follow
from plumbline.estimators import output_error
from plumbline.models.loop import Scene, Term, simulate

OMEGA = PUBLISHED["A"]["omega"]
LAWS = {k: e for k, e in catalogue().items() if e.ledger == "control" and e.law}


def scene(**options: float) -> Scene:
    """Twelve loci of set A, the limits and regimes of the truth."""
    loci = made("A", 1, n=6, **options)
    fine = batch.of_loci([one.x for one in loci], [one.p for one in loci], OMEGA, RATE)
    regime = np.zeros(fine.x.shape, np.int8)
    for j, one in enumerate(loci):
        rows = slice(fine.lead, fine.end[j])
        regime[rows, j] = (one.p_true >= 0.1 - 1e-12).astype(int) - (one.p_true <= -0.1 + 1e-12)
    coarse, thin = law.thinned(fine, regime)
    return Scene(coarse, thin, OMEGA, (-0.1, 0.1), np.zeros(len(loci)), np.zeros(len(loci)))


@pytest.mark.parametrize("name", LAWS)
def test_an_effect_of_size_zero_changes_nothing(name: str) -> None:
    """Every variant of every control effect of the catalogue."""
    stage = scene()
    plain = np.array([0.0, 4.0, 0.9])[:, None, None]
    for term in LAWS[name].law:
        count = len(LAWS[name].parameters)
        got = simulate(np.concatenate([plain, np.zeros((count, 1, 1))]), stage, [(term, count)])
        np.testing.assert_allclose(got, simulate(plain, stage), atol=1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_a_term_has_starts_and_steps_for_each_parameter(name: str) -> None:
    """One step per size, sizes to begin from within the bounds; what needs company names effects that exist."""
    effect = LAWS[name]
    for term in effect.law:
        assert len(term.steps) == len(effect.parameters)
        assert set(term.beside) <= set(LAWS)
        for start in term.starts:
            assert all(p.lower <= s <= p.upper for p, s in zip(effect.parameters, start, strict=True))


def test_a_delay_is_that_of_the_law_without_terms() -> None:
    """CoM and ZMP within 0.1 and 0.6 mm rms of the estimator that knows only a delay."""
    stage = scene()
    point = np.array([0.0, 4.0, 0.9, 0.07])
    got = simulate(point[:, None, None], stage, [(LAWS["delay"].law[0], 1)])
    old = output_error.simulate(point[:, None], stage.batch, stage.regime, OMEGA, stage.limits)
    rms = np.sqrt(np.mean((got - old) ** 2, axis=(1, 2, 3)))
    assert rms[0] < 1e-4
    assert rms[1] < 6e-4


@pytest.mark.parametrize("step", [0.02, 0.005])
def test_a_lag_is_the_same_at_any_rate(step: float) -> None:
    """A command that rises straight from rest is followed as the differential equation says, t - T (1 - exp(-t/T)), T = 80 ms."""
    t = step * np.arange(1, 60)
    now, got = SimpleNamespace(step=step, kept=np.zeros(()), before=np.zeros(())), []
    for command in t:
        now.kept = follow(command, now, [np.array(0.08)])  # type: ignore[arg-type]
        now.before = command
        got.append(float(now.kept))
    np.testing.assert_allclose(got, t - 0.08 * (1 - np.exp(-t / 0.08)), atol=1e-12)


def test_the_true_law_follows_a_motion_without_noise() -> None:
    """CoM within 0.2 mm rms; frame by frame the CoM is left as measured."""
    stage = scene(feedback_sd=0.0, marker_noise=0.0, cop_noise=0.0)
    point = np.array([0.0, PUBLISHED["A"]["k1"], PUBLISHED["A"]["k2"]])[:, None, None]
    assert np.sqrt(np.mean(simulate(point, stage)[0] ** 2)) < 2e-4
    assert not simulate(point, stage, closed=False)[0].any()


def test_a_stage_that_the_loop_does_not_have_is_refused() -> None:
    """The message lists those it has."""
    with pytest.raises(ValueError, match="seen, reference, place"):
        Term("elsewhere", lambda now, sizes: sizes[0], ((0.0,),), (1.0,))


def test_where_law_and_measurement_are_at_the_same_limit_nothing_is_simulated() -> None:
    """A limit half a millimetre off changes no CoM while both are there; at the other limit it counts."""
    stage = scene()
    beyond = np.array([-0.3, 20.0, 0.0])[:, None, None]  # asks for more than the right limit wherever the CoM is
    moved = replace(stage, limits=(-0.1, 0.0995))
    dp = simulate(beyond, moved)[1][:, 0]
    right = (stage.regime > 0) & stage.batch.inside
    assert right.any()
    assert not dp[right].any()
    assert np.abs(dp[(stage.regime < 0) & stage.batch.inside]).min() > 0.1
