"""A personal CoM from still poses: against simulated people whose masses nobody told."""

from functools import cache

import made_person
import numpy as np
import pytest

from plumbline import guidance
from plumbline.calibration import Calibration, Told, calibrate
from plumbline.models.sesc import USUAL, Noise, spread
from plumbline.person_com import Columns, columns
from plumbline.simulate import multi_contact, nine_segments, routes
from plumbline.still import Gate, windows

PEOPLE = 8  # the small twin of the forty of studies/gonzalez2013


@cache
def motion(name: str) -> multi_contact.Motion:
    """A protocol, the same for everybody."""
    made = {"paper": lambda: multi_contact.paper(rate=10.0), "extended": lambda: routes.extended(rate=10.0)}
    made["volume"] = lambda: multi_contact.volume(rate=10.0)
    return made[name]()


@cache
def posed(name: str, tied: bool = False) -> Columns:
    return columns(made_person.body(motion(name).joints), tied)


def told(name: str, person: nine_segments.Body, tied: bool = False) -> list[Told]:
    """Still windows of one person in a protocol; its noise is that of 100 Hz, although fewer frames are simulated."""
    recording = multi_contact.record(motion(name), person, seed=int(person.participant_id[-2:]), white=0.003 * np.sqrt(0.1))
    body = made_person.body(recording.joints)
    found = windows(body, made_person.forces(recording), recording.time, person.mass, Gate(), tied)[1]
    return [(name, w) for w in found if not w.reason]


@cache
def calibrated(name: str, number: int) -> Calibration:
    person = nine_segments.cohort(PEOPLE)[number]
    return calibrate(told(name, person), {}, posed(name).prior(), Noise(white=0.003 * np.sqrt(0.1)))


def error(cal: Calibration, number: int) -> np.ndarray:
    """Error of the own CoM over the volume, which nobody calibrated on [m], (n, 3)."""
    c = posed("volume")
    truth = multi_contact.record(motion("volume"), nine_segments.cohort(PEOPLE)[number], 1).com
    return np.asarray(c.table + c.basis @ cal.mean - truth)


@pytest.mark.parametrize(("protocol", "goal"), [("paper", 0.007), ("extended", 0.004)])
def test_the_own_com_beats_the_table(protocol: str, goal: float) -> None:
    """Median over people of the mean distance from the true CoM: within the goal, and less than half of the table's."""
    own = [np.linalg.norm(error(calibrated(protocol, k), k), axis=1).mean() for k in range(PEOPLE)]
    table = [
        np.linalg.norm(posed("volume").table - multi_contact.record(motion("volume"), p, 1).com, axis=1).mean()
        for p in nine_segments.cohort(PEOPLE)
    ]
    assert np.median(own) < goal
    assert np.median(own) < 0.5 * np.median(table)


def test_the_vertical_is_called_observable_only_where_it_is() -> None:
    """With feet and hands held in the same places the vertical rests on the CoP's zero: flagged. With other contacts it does not."""
    for protocol, seen in (("paper", False), ("extended", True)):
        cal = calibrated(protocol, 0)
        rests = guidance.rests_on_prior(cal.rows.matrix, posed(protocol).prior().covariance, posed("volume").basis)
        assert (rests < guidance.RESTS) == seen


def test_bands_cover_the_truth() -> None:
    """The predicted sd is of the size of the error: the vertical is within 1.96 of it for most people, and not all of it is width."""
    inside, size = [], []
    for k in range(PEOPLE):
        cal, e = calibrated("extended", k), error(calibrated("extended", k), k)[:, 2]
        sd = np.hypot(spread(posed("volume").basis, cal.covariance)[:, 2], cal.noise.floor)
        inside.append(np.abs(e) < 1.96 * sd)
        size.append(np.mean(e**2) / np.mean(sd**2))
    assert np.mean(inside) > 0.75
    assert 0.2 < np.mean(size) < 2.5


def test_a_constant_error_of_the_cop_is_three_times_as_large_upwards() -> None:
    """Feet and hands fixed, the CoP off by 1 mm forward and no prior to speak of: the CoM goes up or down by 2 to 4 mm."""
    person = nine_segments.draw_subject(1, hidden=False)
    motion_ = motion("paper")
    c = posed("paper", True)
    weak = c.prior(30.0)
    quiet = Noise(white=1e-5, slow=0.0, floor=1e-6, constant=1e-7)

    def found(shift: float) -> np.ndarray:
        recording = multi_contact.record(motion_, person, white=0.0, coloured=0.0)
        body = made_person.body(recording.joints)
        force = made_person.forces(recording)
        force.zmp[:, 1] += shift
        made = [("p", w) for w in windows(body, force, recording.time, person.mass, Gate(), True)[1] if not w.reason]
        return np.asarray(c.basis @ calibrate(made, {}, weak, quiet).mean).mean(axis=0)

    up = (found(0.001) - found(0.0)) / 0.001
    assert up[1] == pytest.approx(1.0, abs=0.1)
    assert 1.5 < abs(up[2]) < 5.0


def test_each_recording_has_its_own_constant_error_of_the_cop() -> None:
    """The same windows in two recordings, the CoP of one off by 4 mm: the difference is the recordings', not noise and not the person's."""
    c, good = posed("extended"), told("extended", nine_segments.cohort(1)[0])
    moved = [("b", type(w)(**{**vars(w), "ground": w.ground + np.array([0.0, 0.004])})) for _, w in good]
    prior = c.prior()
    apart, as_one = (calibrate([*good, *((name, w) for _, w in moved)], {}, prior) for name in ("b", good[0][0]))
    assert apart.posterior.mean[apart.count :].reshape(-1, 2)[:, 1] == pytest.approx([-0.002, 0.002], abs=0.0007)
    assert apart.noise == USUAL
    assert as_one.posterior.misfit > 2.0 * apart.posterior.misfit or as_one.noise.white > USUAL.white


def test_without_a_window_the_table_is_left() -> None:
    """No still window: the parameters are the table's, with the spread of people."""
    prior = posed("paper").prior()
    cal = calibrate([], {}, prior)
    assert not cal.mean.any()
    assert np.allclose(cal.covariance, prior.covariance)


def test_what_no_chain_follows_widens_the_bands() -> None:
    """Ground projections that jump by 10 mm from window to window raise the noise, and with it the bands, until they fit."""
    person = nine_segments.cohort(1)[0]
    good = told("extended", person)
    rng = np.random.default_rng(3)
    bad = [(t, type(w)(**{**vars(w), "ground": w.ground + 0.01 * rng.normal(size=2)})) for t, w in good]
    prior = posed("extended").prior()
    one, two = calibrate(good, {}, prior), calibrate(bad, {}, prior)
    assert one.noise.white * 1.5 < two.noise.white
    assert 0.5 < two.posterior.misfit < 1.5
    assert np.trace(two.covariance) > np.trace(one.covariance)


def test_left_and_right_can_be_tied() -> None:
    """Tied sides have fewer parameters, and a mirrored body of equal sides the same CoM."""
    free, tied = posed("paper"), posed("paper", True)
    assert len(tied.parameters) < len(free.parameters)
    assert not any("right" in p.name or "left" in p.name for p in tied.parameters)
