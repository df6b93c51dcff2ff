"""Still windows: what is used, what is not and why."""

from dataclasses import replace

import made_person
import numpy as np
import pytest

from plumbline.physics import G
from plumbline.simulate import multi_contact, nine_segments, poses, wrenches
from plumbline.still import Gate, windows


def standing(seconds: float = 5.0) -> multi_contact.Recording:
    return multi_contact.record(poses.hold("upright", seconds, 50.0), nine_segments.table(), white=0.0, coloured=0.0)


def reasons(recording: multi_contact.Recording, **changed: object) -> set[str]:
    body, force = made_person.body(recording.joints), made_person.forces(recording)
    return {w.reason for w in windows(body, replace(force, **changed), recording.time, recording.body.mass, Gate())[1]}


def test_somebody_who_stands_still_is_used() -> None:
    """Upright, nothing touches: each whole second is a window, its ground projection that of the CoM."""
    r = standing()
    _, found = windows(made_person.body(r.joints), made_person.forces(r), r.time, r.body.mass, Gate())
    assert len(found) == 5
    assert {w.reason for w in found} == {""}
    assert all(np.allclose(w.ground, r.com[0, :2], atol=1e-9) for w in found)


def test_eq_12_from_all_contacts_is_the_ground_projection() -> None:
    """n x M_o / (W . n) over feet and handles together is the CoM's projection in statics, to 1e-9."""
    r = multi_contact.record(multi_contact.paper(duration=20.0, rate=5.0), nine_segments.draw_subject(3), white=0.0, coloured=0.0)
    assert np.allclose(wrenches.projection(r.contacts), r.com[:, :2], atol=1e-9)


def test_a_hand_that_was_not_measured_is_told_by_the_load() -> None:
    """3 % of body weight on a handle without sensor: said, and the windows are left out."""
    r = standing()
    grf = made_person.forces(r).grf.copy()
    grf[:, 2] *= 0.97
    assert reasons(r, grf=grf) == {"the plates carry 97.0% of body weight: a hand, a seat or a person was not measured"}


def test_a_hand_that_pulls_to_the_side_is_told_by_the_shear() -> None:
    """2 % of body weight to the side while nothing moves."""
    r = standing()
    grf = made_person.forces(r).grf.copy()
    grf[:, 1] += 0.02 * r.body.mass * G
    (said,) = reasons(r, grf=grf)
    assert "pulls to the side while nothing moves" in said


def test_a_zero_error_of_the_shear_is_no_hand() -> None:
    """Plates read up to half a percent of body weight to the side with nobody there: the window is used."""
    r = standing()
    grf = made_person.forces(r).grf.copy()
    grf[:, 1] += 0.004 * r.body.mass * G
    assert reasons(r, grf=grf) == {""}


def test_a_moving_body_is_no_pose() -> None:
    """The CoM at 0.1 m/s, and one that swings by 1 cm at 1 Hz, whose ZMP is 20 mm away from it at the turns."""
    r = standing()
    steady, swing = np.zeros((len(r.time), 3)), np.zeros((len(r.time), 3))
    steady[:, 1], swing[:, 1] = 0.1 * r.time, 0.01 * np.cos(2 * np.pi * r.time)
    force = made_person.forces(r)
    for path, word in ((steady, "moving at 0.10 m/s"), (swing, "motion moves the ZMP")):
        body = made_person.body({k: v + path for k, v in r.joints.items()})
        said = {w.reason for w in windows(body, force, r.time, r.body.mass, Gate())[1]}
        assert all(word in s for s in said)


@pytest.mark.parametrize("lost", ["com", "zmp"])
def test_a_gap_leaves_a_window_out(lost: str) -> None:
    """One frame without CoM or CoP: the window says so, the others stay."""
    r = standing()
    body, force = made_person.body(r.joints), made_person.forces(r)
    (body.proximal if lost == "com" else force.zmp)[60] = np.nan
    said = [w.reason for w in windows(body, force, r.time, r.body.mass, Gate())[1]]
    assert [bool(s) for s in said] == [False, True, False, False, False]
    assert ("markers" if lost == "com" else "centre of pressure") in said[1]
