"""Equations of motion of the personal CoM: they hold for the truth, and tell what it is."""

import made_person
import numpy as np

from plumbline.calibration import calibrate
from plumbline.forces import Forces
from plumbline.moving import EQUATIONS, equations
from plumbline.person_com import columns
from plumbline.physics import G
from plumbline.simulate import multi_contact, nine_segments


def squats(person: nine_segments.Body, rate: float = 50.0) -> tuple[multi_contact.Recording, Forces, np.ndarray]:
    """Somebody who moves through the volume in seconds, free of inertia about the CoM: the force of Newton, the CoP without L'."""
    motion = multi_contact.volume(duration=20.0, rate=rate)
    r = multi_contact.record(motion, person, white=0.0, coloured=0.0)
    a = np.gradient(np.gradient(r.com, r.time, axis=0), r.time, axis=0) + np.array([0.0, 0.0, G])
    p = r.com[:, :2] - r.com[:, 2:] * a[:, :2] / a[:, 2:]
    return r, Forces(person.mass * a, np.column_stack([p, np.zeros(len(p))]), 0.0), np.zeros_like(r.com)


def test_the_truth_obeys_the_equations() -> None:
    """For a person who is the table nothing is left: 1 mm/s2 of force, 0.1 mm of moment."""
    r, force, still = squats(nine_segments.table())
    e = equations(columns(made_person.body(r.joints)), force, still, r.time, r.body.mass)
    left = np.sqrt(np.mean(e.values[:, 2:-2] ** 2, axis=1))
    assert len(e.time) > 100
    assert (left < [1e-3] * 3 + [1e-4] * 2).all(), dict(zip(EQUATIONS, left, strict=True))


def test_motion_tells_a_person_from_the_table() -> None:
    """The same motion by another person: the fit takes nine tenths of the CoM's changes of error with pose away."""
    person = nine_segments.draw_subject(5, hidden=False)
    r, force, still = squats(person)
    c = columns(made_person.body(r.joints))
    cal = calibrate([], {"a": equations(c, force, still, r.time, person.mass)}, c.prior())
    before, after = c.table - r.com, c.table + c.basis @ cal.mean - r.com
    assert np.linalg.norm(after.std(axis=0)) < 0.3 * np.linalg.norm(before.std(axis=0))
    assert np.abs(after[:, :2]).max() < 0.002


def test_a_contact_that_no_plate_measured_is_left_out() -> None:
    """While a seat carries a tenth of the body the windows are gone; without shear there are none at all."""
    r, force, still = squats(nine_segments.table())
    force.grf[300:500, 2] *= 0.9
    e = equations(columns(made_person.body(r.joints)), force, still, r.time, r.body.mass)
    assert not ((e.time > 6.5) & (e.time < 9.5)).any()
    assert ((e.time > 1.0) & (e.time < 5.0)).any()
    force.grf[:, :2] = np.nan
    assert not len(equations(columns(made_person.body(r.joints)), force, still, r.time, r.body.mass).time)
