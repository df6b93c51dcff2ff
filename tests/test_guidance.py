"""Which pose to record next, and how far a motion lies from what was recorded."""

import made_person
import numpy as np
import pytest

from plumbline import guidance
from plumbline.person_com import columns
from plumbline.poses import POSES, posed, straight
from plumbline.simulate import nine_segments


def standing() -> object:
    return made_person.body(nine_segments.joints(np.zeros((1, 3)), np.tile(np.eye(3), (1, 9, 1, 1))))


@pytest.mark.parametrize("name", POSES)
def test_a_pose_bends_joints_and_breaks_no_bones(name: str) -> None:
    """Each segment keeps its length, and joins its neighbour where it did."""
    before, after = standing(), posed(standing(), name)
    assert np.allclose(np.linalg.norm(after.distal - after.proximal, axis=2), np.linalg.norm(before.distal - before.proximal, axis=2))
    for side in ("left", "right"):
        for upper, lower in (("upper_arm", "forearm"), ("thigh", "shank")):
            i, k = (after.names.index(f"{part}_{side}") for part in (upper, lower))
            assert np.allclose(after.distal[0, i], after.proximal[0, k])


def test_arms_ahead_point_ahead_and_the_trunk_bends_ahead() -> None:
    """Positive turns go forward for a limb, which hangs, and for the trunk, which stands; outward to the sides on both sides."""
    names = ("stand, both arms straight ahead", "stand, trunk bent 60 degrees ahead", "stand, both arms to the sides")
    ahead, bent, side = (posed(standing(), k) for k in names)
    hand = ahead.names.index("forearm_right")
    assert ahead.distal[0, hand, 1] > 0.4
    assert bent.proximal[0, 0, 1] > 0.4
    left, right = (side.distal[0, side.names.index(f"forearm_{s}"), 0] for s in ("left", "right"))
    assert left < -0.6 < 0.6 < right


def test_four_holds_tell_the_vertical_to_6_mm_and_one_lying_down_to_3_5() -> None:
    """Of standing poses the best four, held for 5 s each, leave a predicted vertical sd below 6 mm; with one lying down below 3.5 mm."""
    from plumbline.models.sesc import USUAL
    from plumbline.sesc import hold_sd

    candidates = {k: np.hstack([columns(posed(standing(), k)).basis[0, :2], np.eye(2)]) for k in POSES}
    up = {k: v for k, v in candidates.items() if k.startswith(("stand", "squat", "half"))}
    prior = columns(standing()).prior().covariance
    wide = np.zeros((len(prior) + 2, len(prior) + 2))
    wide[:-2, :-2], wide[-2:, -2:] = prior, USUAL.constant**2 * np.eye(2)
    motion = np.stack(
        [np.hstack([columns(posed(standing(), k)).basis[0], np.zeros((3, 2))]) for k in ("half squat", "stand upright, arms down")]
    )
    held = guidance.next_poses(wide, motion, up, hold_sd(USUAL), 4)
    assert held[-1].sd[2] < 0.006
    assert (np.diff([s.sd[2] for s in held]) < 0).all()
    supine = {k: v for k, v in candidates.items() if k.startswith("lie on the back")}
    more = {**up, **supine}
    assert guidance.next_poses(wide, motion, more, hold_sd(USUAL), 4)[-1].sd[2] < 0.0035


def test_the_best_pose_is_the_one_that_lowers_the_variance_most() -> None:
    """Against all candidates tried by hand."""
    rng = np.random.default_rng(1)
    motion, covariance = rng.normal(size=(20, 3, 5)), np.diag(rng.uniform(0.5, 2.0, 5))
    candidates = {str(k): rng.normal(size=(2, 5)) for k in range(6)}
    total = {}
    for name, h in candidates.items():
        after = np.linalg.inv(np.linalg.inv(covariance) + h.T @ h / 0.1**2)
        total[name] = np.einsum("nij,jk,nik->", motion, after, motion)
    assert guidance.next_poses(covariance, motion, candidates, 0.1)[0].pose == min(total, key=total.__getitem__)


def test_frames_far_from_every_pose_are_outside() -> None:
    """A segment turned by 30 degrees from where it ever pointed lies outside of 0.35 rad, one turned by 10 inside."""
    u = np.tile([0.0, 0.0, -1.0], (1, 2, 1))
    frames = u.repeat(2, axis=0)
    for k, angle in enumerate(np.radians([10.0, 30.0])):
        frames[k, 1] = [np.sin(angle), 0.0, -np.cos(angle)]
    assert guidance.outside(frames, u, 0.35).tolist() == [False, True]


def test_a_figure_is_put_straight() -> None:
    """From a squat with arms ahead back to hanging limbs: the standing figure's directions, lengths and joints."""
    bent = posed(standing(), "squat, arms ahead")
    back = straight(bent)
    for name in ("thigh_left", "shank_right", "upper_arm_left", "forearm_right"):
        i = back.names.index(name)
        u = back.distal[0, i] - back.proximal[0, i]
        assert np.allclose(u / np.linalg.norm(u), [0, 0, -1])
    knee = back.names.index("shank_right")
    assert np.allclose(back.proximal[0, knee], back.distal[0, back.names.index("thigh_right")])
