"""The nine-segment person keeps feet and hands where they are, balances their weight, and differs from the table as said."""

import numpy as np
import pytest

from plumbline.simulate import multi_contact as mc
from plumbline.simulate import nine_segments as nine
from plumbline.simulate import poses, routes, wrenches
from plumbline.simulate.multi_contact import Motion
from plumbline.simulate.nine_segments import INDEX

QUIET = {"white": 0.0, "coloured": 0.0}
PERSON = nine.draw_subject(3)


@pytest.fixture(scope="module")
def paper() -> Motion:
    return mc.paper(rate=10.0)


@pytest.fixture(scope="module")
def risen() -> Motion:
    return mc.sit_to_stand(rate=50.0)


@pytest.fixture(scope="module")
def extended() -> Motion:
    """A part of the long protocol: handles of two heights, a released hand, sitting down."""
    ways = [routes.EXTENDED[i] for i in (0, 1, 5, 7, 22, 24, 26)]
    return routes.extended(rate=10.0, ways=ways, move=2.0, hold=2.0)


def _flexion(motion: Motion, lower: str, upper: str) -> np.ndarray:
    """Bend of a limb about the right-pointing axis of its upper part [degrees]."""
    upper_axes = motion.pose.rotations[:, INDEX[upper]]
    along = np.einsum("nji,nj->ni", upper_axes, -motion.pose.rotations[:, INDEX[lower]][:, :, 2])
    return np.degrees(np.arctan2(along[:, 1], -along[:, 2]))


def test_feet_and_hands_stay(paper: Motion) -> None:
    """In the paper's protocol the contacts move by less than 1 um while the CoM moves by 140, 100 and 100 mm."""
    for name in ("ankle_l", "ankle_r", "hand_l", "hand_r"):
        assert np.ptp(paper.joints[name], axis=0).max() < 1e-6, name
    com = nine.table().com(paper.pose.pelvis, paper.pose.rotations)
    np.testing.assert_allclose(np.ptp(com, axis=0), [0.14, 0.10, 0.10], atol=1e-4)


def test_fixed_contacts_hide_a_direction(paper: Motion) -> None:
    """With feet and hands fixed the chain of summed segment axes has a B v that never changes: height against limb lengths."""
    axes = paper.pose.rotations[..., 2]
    summed = [axes[:, INDEX[f"{kind}_l"]] + axes[:, INDEX[f"{kind}_r"]] for kind in nine.KINDS]
    b = np.stack([*np.moveaxis(paper.pose.rotations[:, 0], 2, 0), *summed], axis=2)
    length = [nine.LENGTH[kind] for kind in nine.KINDS]
    v = np.array([0.0, 0.0, 2 * nine.SHOULDER[2], -length[0], -length[1], length[2], length[3]])
    assert np.ptp(b @ v, axis=0).max() < 1e-6
    assert np.ptp(b @ (v * [1, 1, 1, 1, 1, 1, -1]), axis=0).max() > 1e-2


@pytest.mark.parametrize("name", ["paper", "extended", "risen"])
def test_segments_keep_their_length(name: str, request: pytest.FixtureRequest) -> None:
    """Forward kinematics change no length, and rotations are rotations."""
    motion = request.getfixturevalue(name)
    for side in "lr":
        for kind, (a, b) in {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "hand"), "thigh": ("hip", "knee")}.items():
            length = np.linalg.norm(motion.joints[f"{a}_{side}"] - motion.joints[f"{b}_{side}"], axis=1)
            np.testing.assert_allclose(length, nine.LENGTH[kind], atol=1e-9)
    turned = motion.pose.rotations @ motion.pose.rotations.swapaxes(2, 3)
    np.testing.assert_allclose(turned, np.broadcast_to(np.eye(3), turned.shape), atol=1e-9)


@pytest.mark.parametrize("name", ["paper", "extended", "risen"])
def test_joints_stay_human(name: str, request: pytest.FixtureRequest) -> None:
    """Knees and elbows bend one way, up to 150 degrees; the trunk leans less than 90; hips with the lumbar spine lift less than 140."""
    motion = request.getfixturevalue(name)
    for side in "lr":
        knee, elbow = _flexion(motion, f"shank_{side}", f"thigh_{side}"), _flexion(motion, f"forearm_{side}", f"upper_arm_{side}")
        assert knee.min() > -150
        assert knee.max() < 5
        assert elbow.min() > -5
        assert elbow.max() < 150
        assert _flexion(motion, f"thigh_{side}", "trunk").max() < 140
    assert motion.pose.rotations[:, 0, 2, 2].min() > 0


@pytest.mark.parametrize("name", ["paper", "extended"])
def test_statics_balance(name: str, request: pytest.FixtureRequest) -> None:
    """At rest reactions carry the weight, turn nothing about the CoM, and eq. (12) gives the CoM's projection to 1e-9 m."""
    record = mc.record(request.getfixturevalue(name), PERSON, **QUIET)
    force = sum(c.force for c in record.contacts)
    moment = sum(np.cross(c.point - record.com, c.force) + c.moment for c in record.contacts)
    np.testing.assert_allclose(force, np.tile([0, 0, PERSON.mass * 9.81], (len(force), 1)), atol=1e-9)
    np.testing.assert_allclose(moment, 0, atol=1e-9)
    about_origin = sum(np.cross(c.point, c.force) + c.moment for c in record.contacts)
    projected = np.cross([0.0, 0.0, 1.0], about_origin)[:, :2] / force[:, 2:]
    np.testing.assert_allclose(projected, record.com[:, :2], atol=1e-9)
    np.testing.assert_allclose(record.ground, projected + PERSON.bias, atol=1e-9)


def test_standing_up_needs_force(risen: Motion) -> None:
    """Standing up, the forces accelerate the CoM: the load exceeds the weight; the seat is left; eq. (12) is not the CoM."""
    record = mc.record(risen, PERSON, **QUIET)
    load = sum(c.force[:, 2] for c in record.contacts)
    rise = np.gradient(np.gradient(record.com[:, 2], record.time), record.time)
    np.testing.assert_allclose(load[3:-3] / PERSON.mass - 9.81, rise[3:-3], atol=0.1)
    assert load.max() > 1.04 * PERSON.mass * 9.81
    np.testing.assert_allclose(record.ground - PERSON.bias, wrenches.projection(record.contacts), atol=1e-9)
    assert np.abs(record.ground - record.com[:, :2]).max() > 0.02
    seat = next(c for c in record.contacts if c.name == "seat")
    assert seat.force[0, 2] > 100
    assert np.abs(seat.force[len(seat.force) // 2 :]).max() == 0


def test_hands_are_released(extended: Motion) -> None:
    """In the long protocol a hand that is on its way or free carries nothing, a held hand does not move."""
    for grip in extended.grips:
        assert grip.load.min() == 0
        assert grip.load.max() == 1
        moved = np.linalg.norm(np.diff(grip.point, axis=0), axis=1)
        held = np.minimum(grip.load[1:], grip.load[:-1]) > 0
        assert moved[held].max() < 1e-9


@pytest.mark.parametrize("name", poses.POSES)
def test_poses_are_held(name: str) -> None:
    """Every named pose stands on its supports with a load that pushes, and nothing is below the floor."""
    motion = poses.hold(name, seconds=0.05)
    record = mc.record(motion, PERSON, **QUIET)
    np.testing.assert_allclose(wrenches.projection(record.contacts), record.com[:, :2], atol=1e-9)
    assert all(c.force[:, 2].min() > 0 for c in record.contacts)
    assert min(place[:, 2].min() for place in motion.joints.values()) > 0.05
    for side in "lr":
        assert -150 < _flexion(motion, f"shank_{side}", f"thigh_{side}")[0] < 5
        assert -5 < _flexion(motion, f"forearm_{side}", f"upper_arm_{side}")[0] < 150


def test_lying_turns_the_vertical() -> None:
    """Supine, the floor sees along its length what stood upright: the CoM lies a body's height of the CoM from the ankles."""
    body = nine.table()
    up, down = poses.hold("upright", 0.05), poses.hold("supine", 0.05)
    high = body.com(up.pose.pelvis, up.pose.rotations)[0, 2] - up.joints["ankle_l"][0, 2]
    along = abs(body.com(down.pose.pelvis, down.pose.rotations, down.feet)[0, 1] - down.joints["ankle_l"][0, 1])
    assert high == pytest.approx(along, abs=0.05)


def test_seed_makes_the_person() -> None:
    """The same seed is the same person, another seed another one; masses are a whole of one; the hidden parts are hidden on request."""
    again, other, plain = nine.draw_subject(3), nine.draw_subject(4), nine.draw_subject(3, hidden=False)
    np.testing.assert_array_equal(PERSON.coms, again.coms)
    np.testing.assert_array_equal(PERSON.masses, again.masses)
    assert not np.allclose(PERSON.masses, other.masses)
    for body in (PERSON, other, plain, nine.table()):
        assert body.masses.sum() + body.feet.sum() == pytest.approx(1, abs=1e-12)
    assert plain.feet.sum() == 0
    np.testing.assert_array_equal(plain.masses[1::2], plain.masses[2::2])
    off = np.linalg.norm(PERSON.coms[1:, :2], axis=1)
    np.testing.assert_allclose(off, 0.006, atol=1e-12)


def test_people_differ_as_said(paper: Motion) -> None:
    """Over forty people the table misses the CoM by the 14 mm (median) and 28 mm (p90) that the spreads of mass and CoM amount to."""
    few = slice(None, None, 50)
    pelvis, rotations = paper.pose.pelvis[few], paper.pose.rotations[few]
    guess = nine.table().com(pelvis, rotations)
    missed = [np.linalg.norm(body.com(pelvis, rotations) - guess, axis=1).mean() for body in nine.cohort()]
    assert 0.011 < np.median(missed) < 0.019
    assert 0.022 < np.percentile(missed, 90) < 0.034


def test_noise_has_its_size() -> None:
    """White 3 mm and coloured 2 mm of 2 s (seed 1): sd of the whole, and of its mean over windows of a second."""
    noise = mc.ground_noise(np.arange(200000) / 100, 1)
    np.testing.assert_allclose(noise.std(axis=0), np.hypot(0.003, 0.002), rtol=0.05)
    means = noise.reshape(-1, 100, 2).mean(axis=1)
    np.testing.assert_allclose(np.sum(means[1:] * means[:-1], axis=0) / np.sum(means**2, axis=0), 0.63, atol=0.1)


def test_sensors_err_as_said(paper: Motion) -> None:
    """Misalignment is constant in the segment's axes, orientation noise is not; plates shift, hands lie or are missing (seed 2)."""
    rotations = paper.pose.rotations[::10]
    wrong = rotations.swapaxes(2, 3) @ mc.misaligned(rotations, 2)
    np.testing.assert_allclose(wrong, np.broadcast_to(wrong[0], wrong.shape), atol=1e-12)
    shaken = mc.shaken(rotations, 2) @ rotations.swapaxes(2, 3)
    angle = np.stack([shaken[..., 2, 1], shaken[..., 0, 2], shaken[..., 1, 0]])
    assert np.degrees(angle.std()) == pytest.approx(0.4, rel=0.1)
    record = mc.record(paper, PERSON, **QUIET)
    shift = wrenches.projection(wrenches.shifted(record.contacts, 2)) - record.com[:, :2]
    assert 1e-4 < np.abs(shift).max() < 0.01
    for contacts in (wrenches.without(record.contacts, "hand_l"), wrenches.offset(record.contacts, 2)):
        assert np.abs(wrenches.projection(contacts) - record.com[:, :2]).max() > 1e-3
    assert np.abs(sum(c.force[:, 2] for c in wrenches.without(record.contacts, "hand_l")) / (70 * 9.81) - 1).max() > 0.03
