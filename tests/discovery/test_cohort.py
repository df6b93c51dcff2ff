"""Cohorts of simulated studies: the draws are reproducible, possible, and what they say they are."""

from dataclasses import replace

import numpy as np
import pytest

from plumbline.physics import G
from plumbline.simulate import cohort
from plumbline.simulate.control import Controller
from plumbline.simulate.hidden import EFFECTS, Setup
from plumbline.simulate.human import Habits, Push, draw_subject, simulate


def test_a_seed_draws_the_same_study_and_another_seed_another() -> None:
    """Truth is a function of seed and kind; the kinds hide nothing, one, two effects, or one outside the catalogue."""
    assert cohort.draw(4, "two").truth() == cohort.draw(4, "two").truth()
    assert cohort.draw(4, "two").truth() != cohort.draw(5, "two").truth()
    for seed in range(40):
        assert cohort.draw(seed, "clean").effects == {}
        assert len(cohort.draw(seed, "one").effects) == 1
        assert not cohort.draw(seed, "outside").truth()["inside"]
        pair = set(cohort.draw(seed, "two").effects)
        assert len(pair) == 2
        assert not any(pair <= clash for clash in cohort.CLASHES)
    with pytest.raises(ValueError, match="no kind of study is called 'three'"):
        cohort.draw(1, "three")


def test_sizes_span_from_small_to_large() -> None:
    """Over its share from 0 to 1 each effect grows from its smallest to its largest size, and every size can be simulated."""
    for name, sizes in (cohort.INSIDE | cohort.BEYOND).items():
        small, large = (sizes(np.random.default_rng(1), share) for share in (0.0, 1.0))
        grown = [abs(large[k] / v) for k, v in small.items() if not isinstance(v, str) and v]
        assert max(abs(np.log(grown))) > 0.9, name
        EFFECTS[name](Setup(1, np.random.default_rng(0), Habits(), Controller()), **large)


def test_drawn_laws_keep_the_drawn_people_standing() -> None:
    """With delays and lags as drawn, the linear loop settles; a law with too long a delay does not."""
    for seed in range(30):
        case = cohort.draw(seed, "one", names=("delay",))
        for subject, controller in zip(case.subjects, case.controllers, strict=True):
            law, omega = controller.lateral, float(np.sqrt(G / (0.56 * subject.height)))
            assert cohort.settles(float(law.k1), float(law.k2), omega, case.effects["delay"]["delay"], 0.0)
            assert -subject.reach <= law.low < law.reference < law.high <= subject.reach
    assert not cohort.settles(3.0, 0.7, 3.2, 0.4, 0.0)


def test_own_bias_is_the_stretch_of_the_table_com() -> None:
    """The table's CoM of a person who deviates moves 1 + bias times as far as the true one, to 0.002; 0 for the table's own person."""
    assert cohort.bias(draw_subject("sub-01", 5)) == pytest.approx(0.0, abs=1e-12)
    person = draw_subject("sub-01", 11, personal=0.06)
    trial = simulate(person, trials=1, duration=2.5, seed=2, marker_noise=0.0, touches=[[Push(0.2, 0.25, 150.0)]])[0]
    table = replace(person, segments=person.nominal)
    same = simulate(table, trials=1, duration=2.5, seed=2, marker_noise=0.0, touches=[[Push(0.2, 0.25, 150.0)]])[0]
    hips, other = trial.markers["PELV"][:, 0], same.markers["PELV"][:, 0]
    slope = np.polyfit(other, same.truth["com_x"], 1)[0] / np.polyfit(hips, trial.truth["com_x"], 1)[0]
    assert abs(cohort.bias(person)) > 0.003
    assert slope - 1 == pytest.approx(cohort.bias(person), abs=2e-3)


def test_people_of_a_study_have_their_own_laws() -> None:
    """Simulated at once, each subject's ZMP follows their own law and lean, as it does alone."""
    case = cohort.draw(3, "clean", people=2, trials=1, duration=3.0, rate=100.0, marker_noise=0.0, force_noise=0.0)
    trials = case.simulate()
    for trial, controller in zip(trials, case.controllers, strict=True):
        law, t = controller.lateral, trial.truth
        e, free = t["com_x"] - law.reference, np.ones(len(trial.time), dtype=bool)
        for touch in trial.touches:
            free &= (trial.time < touch.onset) | (trial.time > touch.onset + touch.duration)
        left = t["zmp_x"] - np.clip(law.reference + law.k1 * e + law.k2 * t["com_dot_x"], law.low, law.high)
        assert np.std(left[free]) < 2.5 * law.noise
    assert case.controllers[0] != case.controllers[1]
