"""Forces at the frames' times: no shift, nothing lost under a light foot, nothing gained from an empty plate; CoM from forces."""

from pathlib import Path

import numpy as np
import pytest
from made_recording import SOMEBODY, Array, Plate, columns, pendulum

from plumbline import com_force, contact, forces, loads
from plumbline.contact import Foot
from plumbline.effects import Channels, catalogue
from plumbline.markerset import load
from plumbline.readers.raw import RawPlate
from plumbline.signals import signals


@pytest.mark.parametrize("width", [1.0, 2.0, 2.5, 4.17, 9.0, 10.0])
def test_averages_are_centred(width: float) -> None:
    """Weights are symmetric, sum to one, and give the exact mean of t^2's linear interpolant."""
    w = forces.box_weights(width)
    j = np.arange(len(w)) - len(w) // 2
    np.testing.assert_allclose(w, w[::-1])
    assert w.sum() == pytest.approx(1.0)
    fine = np.linspace(-width / 2, width / 2, 200001)
    assert w @ (j**2.0) == pytest.approx(float(np.mean(np.interp(fine, j, j**2.0))), rel=1e-4)


@pytest.mark.parametrize(("rate", "force_rate"), [(100, 1000), (120, 1080), (240, 1000), (100, 100), (200, 100), (60, 960)])
def test_forces_do_not_shift_in_time(rate: int, force_rate: int) -> None:
    """A ramp arrives exactly, and a 3 Hz sine with a time error below 10 us, whatever the two rates; the ends included."""
    t, frames = np.arange(4 * force_rate + 1) / force_rate, np.arange(4 * rate) / rate
    sine = np.sin(2 * np.pi * 3.0 * t)
    got = forces.at_frames(np.column_stack([5.0 + 2.0 * t, sine]), t, frames)
    np.testing.assert_allclose(got[:, 0], 5.0 + 2.0 * frames, atol=1e-9)
    inner = slice(rate, 3 * rate)
    phase = np.mean(got[inner, 1] * np.exp(-2j * np.pi * 3.0 * frames[inner])) * 2j
    assert abs(np.angle(phase)) / (2 * np.pi * 3.0) < 1e-5


def test_outside_the_force_record_is_nothing() -> None:
    """Frames before and after the forces are NaN; the first and last frame inside are not."""
    t, frames = 0.5 + np.arange(1001) / 1000.0, np.arange(200) / 100.0
    got = forces.at_frames(np.ones((1001, 1)), t, frames)[:, 0]
    np.testing.assert_array_equal(np.isfinite(got), (frames > 0.499) & (frames < 1.501))


def standing(n: int = 1001, left: float = 0.4, load: float = 700.0) -> list[Plate]:
    """Two plates at 1 kHz that share a load, CoPs at x = -0.1 and 0.15, at different heights of 0 and 0."""
    t = np.arange(n) / 1000.0
    out = []
    for share, x, foot in ((left, -0.10, "left"), (1 - left, 0.15, "right")):
        force = np.tile([10.0 * share, -5.0 * share, load * share], (n, 1))
        corners = np.array([[x + 0.1, 0.3, 0], [x - 0.1, 0.3, 0], [x - 0.1, -0.3, 0], [x + 0.1, -0.3, 0.0]])
        out.append(Plate(t, force, np.tile([x, 0.05, 0.0], (n, 1)), np.full(n, 0.2), corners, foot))
    return out


def test_two_plates_make_one_zmp() -> None:
    """The net ZMP is the load-weighted mean of the two CoPs, each foot keeps its own, forces add."""
    got = forces.net(standing(), np.arange(100) / 100.0)
    np.testing.assert_allclose(got.zmp, np.tile([0.4 * -0.10 + 0.6 * 0.15, 0.05, 0.0], (100, 1)))
    np.testing.assert_allclose(got.grf, np.tile([10.0, -5.0, 700.0], (100, 1)))
    np.testing.assert_allclose(got.feet["left"][1][:, 0], -0.10)
    np.testing.assert_allclose(got.feet["right"][0][:, 2], 420.0)


def test_the_zmp_lies_in_the_plates_plane_without_horizontal_moment() -> None:
    """On plates of unequal height the wrench of all plates has no horizontal moment about the ZMP at their mean height."""
    plates = standing()
    plates[1].cop[:, 2] = 0.10
    plates[1].settle()
    got = forces.net(plates, np.arange(50) / 100.0)
    assert got.surface == pytest.approx(0.05)
    moment = np.sum([np.cross(p.cop[0] - got.zmp[20], p.force[0]) for p in plates], axis=0)
    np.testing.assert_allclose(moment[:2], 0.0, atol=1e-9)


def reading(load: float, start: float, end: float) -> list[Plate]:
    """`standing`, with the left plate reading `load` [N] at its CoP between two times [s], too little for a CoP of its own."""
    plates = standing()
    part = (plates[0].time >= start) & (plates[0].time < end)
    plates[0].force[part] = [0.0, 0.0, load]
    plates[0].settle()
    plates[0].cop[part] = plates[0].free_moment[part] = np.nan
    return plates


@pytest.mark.parametrize("lasts", [0.05, 0.7])
def test_a_light_foot_counts_however_long(lasts: float) -> None:
    """15 N on a plate, for 50 ms or for 0.7 s, keep their place in the net wrench, with and without markers of a resting foot."""
    plates = reading(15.0, 0.2, 0.2 + lasts)
    frames = np.arange(100) / 100.0
    for feet in ({}, contact.of_feet(foot_markers(), {}, frames)):
        got = forces.net(plates, frames, feet)
        assert got.grf[22, 2] == pytest.approx(435.0)
        assert got.zmp[22, 0] == pytest.approx((15 * -0.10 + 420 * 0.15) / 435.0)
        assert not any("empty" in n for n in got.notes)


def foot_markers(n: int = 100) -> dict[str, Array]:
    """Two resting feet on the plates of `standing`."""
    places = {"LHEE": (-0.10, -0.08), "LTOE": (-0.10, 0.12), "RHEE": (0.15, -0.08), "RTOE": (0.15, 0.12)}
    return {k: np.tile([x, y, 0.04], (n, 1)) for k, (x, y) in places.items()}


@pytest.mark.parametrize("error", [-27.0, 12.0, 48.0])
@pytest.mark.parametrize("away", [(0.0, 0.0, 0.1), (0.0, 0.9, 0.0)])
def test_a_plate_whose_foot_is_away_moves_nothing(error: float, away: tuple[float, float, float]) -> None:
    """While its foot is lifted, or stands elsewhere, a plate is empty whatever its zero error, and a note counts the frames."""
    plates, markers = reading(error, 0.3, 0.8), foot_markers()
    for label in ("LHEE", "LTOE"):
        markers[label][30:80] += away
    frames = np.arange(100) / 100.0
    got = forces.net(plates, frames, contact.of_feet(markers, {}, frames))
    np.testing.assert_allclose(got.zmp[32:78, 0], 0.15)
    np.testing.assert_allclose(got.grf[32:78, 2], 420.0)
    np.testing.assert_allclose(got.zmp[[*range(28), *range(82, 100)], 0], 0.05)
    assert any("plate 1: taken as empty in 49 of 100 frames (no foot is on it)" in n for n in got.notes)


def test_without_markers_a_zero_error_shows_at_the_ends() -> None:
    """Without markers a light plate counts as load, and the notes say so; as empty only at the level it has at an end of the file."""
    frames = np.arange(100) / 100.0
    got = forces.net(reading(12.0, 0.3, 0.8), frames)
    np.testing.assert_allclose(got.grf[32:78, 2], 432.0)
    assert any("as a foot or as a zero error" in n for n in got.notes)
    plates = reading(12.0, 0.3, 2.0)
    assert any("at an end of the file" in n for n in forces.net(plates, frames).notes)
    np.testing.assert_allclose(forces.net(plates, frames).zmp[32:, 0], 0.15)


def test_a_gap_in_a_force_channel_is_a_gap() -> None:
    """Missing force samples leave the net force and ZMP missing there, not smaller."""
    plates = standing()
    plates[0].force[500:520] = plates[0].moment[500:520] = np.nan
    got = forces.net(plates, np.arange(100) / 100.0)
    assert np.isnan(got.grf[51]).all()
    assert np.isnan(got.zmp[51]).all()
    assert np.isfinite(got.zmp[:49]).all()


def test_a_loaded_plate_without_cop_gives_force_and_no_zmp() -> None:
    """Where a loaded plate lost its CoP the net force stands, the ZMP is NaN, and a note says so."""
    plates = standing()
    plates[1].moment[400:420] = np.nan
    got = forces.net(plates, np.arange(100) / 100.0)
    assert np.isnan(got.zmp[41]).all()
    assert np.isfinite(got.zmp[30:39]).all()
    np.testing.assert_allclose(got.grf[:, 2], 700.0)
    assert "loaded without a CoP in 20 samples" in got.notes[0]


def test_missing_shear_stays_missing() -> None:
    """A plate without horizontal forces gives a vertical force and a ZMP, and no shear."""
    plates = standing()
    for p in plates:
        p.force[:, :2] = np.nan
        p.settle()
    got = forces.net(plates, np.arange(100) / 100.0)
    assert np.isnan(got.grf[:, :2]).all()
    np.testing.assert_allclose(got.zmp[:, 0], 0.05)


# -- CoM from forces --------------------------------------------------------------------------------------------------


def test_the_com_comes_back_from_the_forces() -> None:
    """Sway between 0.07 and 1.1 Hz is recovered to 0.5 mm, ends included, and to 0.05 mm but for its mean."""
    t, com, grf, zmp = pendulum()
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    assert np.abs(got - com).max() < 5e-4
    assert (got - com).std(axis=0).max() < 5e-5


def test_force_noise_and_a_zero_error_stay_bounded() -> None:
    """1 N of noise on the shear and a zero error of 4 N, which a plain double integral turns into metres, leave less than 1 mm."""
    t, com, grf, zmp = pendulum()
    grf = grf + np.random.default_rng(5).normal(size=grf.shape) + np.array([4.0, 0.0, 0.0])
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    plain = np.cumsum(np.cumsum(grf[:, 0] / 70.0)) * 1e-4
    assert np.abs(got - com)[:, 0].max() < 1e-3
    assert np.abs(plain).max() > 1.0


def test_gaps_in_the_force_leave_gaps_in_its_com() -> None:
    """NaN in the ZMP is NaN in the CoM; runs shorter than a second are not integrated."""
    t, com, grf, zmp = pendulum()
    zmp[1000:1010] = np.nan
    zmp[1060] = np.nan
    got = com_force.com_from_force(grf, zmp, t, 70.0, 0.95)
    assert np.isnan(got[1000:1061]).all()
    assert np.abs(got - com)[:1000].max() < 2e-3


# -- simulated people -------------------------------------------------------------------------------------------------


def test_a_light_foot_keeps_the_net_zmp_and_the_support(tmp_path: Path) -> None:
    """Pushed to the limit of the ZMP, where one foot bears less than 20 N, the net ZMP is the truth within 0.3 mm rms at 1 N of
    noise as it is elsewhere, without a mean error; both feet stay support, and only who starts outside of it is from beyond."""
    from plumbline import study
    from plumbline.loci import split
    from plumbline.pushes import pushes
    from plumbline.recording import assemble
    from plumbline.simulate.human import Lean, Push, draw_subject
    from plumbline.simulate.study import write_study

    man = draw_subject("sub-01", seed=1, mass=90.0, height=1.80)
    touches = [[Lean(1.0, 2.4, 0.30, 0.45)], [Push(1.0, 0.25, 210.0), Push(3.5, 0.25, -250.0)]]
    truths = [t.truth for t in write_study(tmp_path, [man], trials=2, duration=6.0, seed=7, touches=touches)]
    found = study.find(tmp_path)
    wrong, light, kinds = [], [], []
    for trial, truth in zip(found.trials, truths, strict=True):
        recording = assemble(trial)
        f = signals(recording, SOMEBODY, load(tmp_path / "raw" / "markerset.yaml"), cutoff=2.0).frames
        straight = np.abs(np.convolve(truth["zmp_x"], [1, -2, 1], "same")) < 1e-4  # where it jumps, 5 ms of the plates are a mean
        wrong.append((columns(f, "zmp")[:, :2] - np.column_stack([truth["zmp_x"], truth["zmp_y"]]))[straight])
        light.append((f[["grf_left_z", "grf_right_z"]].min(axis=1) < 20.0)[straight])
        assert (f["limit_right"] - f["limit_left"]).min() > 0.38
        kinds.append(list(split(f, pushes(f, recording.events, 90.0), recording.events)["kind"]))
    bad, few = np.concatenate(wrong), np.concatenate(light)
    assert few.sum() > 500
    for part in (bad[few], bad[~few]):
        assert np.sqrt(np.mean(part**2, axis=0)).max() < 0.3e-3
        assert np.abs(part.mean(axis=0)).max() < 0.05e-3
    assert kinds == [["recovering_from_beyond"], ["recovering", "recovering"]]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_handle_counts_however_little_it_bears(sign: float) -> None:
    """A hand that pulls 15 N down and 10 N back at 1.1 m stays in the net wrench, with the plates' sign, and leaves the floor's height."""
    n, rng = 500, np.random.default_rng(5)
    pull, place = np.array([2.0, -10.0, -15.0]), np.array([0.2, 0.4, 1.1])
    foot_load, foot_place = np.array([-2.0, 10.0, 715.0]), np.array([0.01, 0.05, 0.0])

    def raw(force: Array, at: Array, foot: str) -> RawPlate:
        shaken = sign * (force + rng.normal(0.0, 0.01, (n, 3)))
        return RawPlate(np.arange(n) / 100.0, shaken, np.zeros((n, 3)), at, None, "text", foot)

    notes: list[str] = []
    carrying = loads.usable([raw(foot_load, foot_place, ""), raw(pull, place, loads.NO_FOOT)], "static", notes)
    assert list(carrying) == [1, 2]
    plates = [loads.reaction(1, carrying[1], np.eye(3))[0], loads.reaction(2, carrying[2], np.eye(3), sign)[0]]
    loads.drop_light(plates)
    assert loads.standing(plates).mass == pytest.approx(700.0 / 9.81, rel=1e-3)
    got = forces.net(plates, np.arange(n) / 100.0, {"left": Foot(np.zeros((n, 1, 3)), np.ones(n, bool))})
    assert got.surface == 0.0
    moment = np.cross(foot_place, foot_load) + np.cross(place, pull)
    np.testing.assert_allclose(got.zmp[250], [-moment[1] / 700.0, moment[0] / 700.0, 0.0], atol=1e-4)


@pytest.mark.parametrize("zero", [(6.0, 0.0), (0.0, 8.0)])
def test_a_zero_error_of_a_hand_is_what_its_effect_says(zero: tuple[float, float]) -> None:
    """A handle at 1.1 m that reads 6 N too much sideways, or 8 N up: what it does to x'' - w2 (x - p) is the effect's column, to 2 %."""
    n, place, pull = 501, np.array([0.3, 0.0, 1.1]), np.array([4.0, 0.0, 12.0])
    extra, time, frames = np.array([zero[0], 0.0, zero[1]]), np.arange(n) / 1000.0, np.arange(50) / 100.0

    def net(force: Array) -> forces.Forces:
        hand = Plate(time, np.tile(force, (n, 1)), np.tile(place, (n, 1)), np.zeros(n), None, loads.NO_FOOT)
        return forces.net([*standing(n, load=690.0), hand], frames)

    true, read = net(pull), net(pull + extra)
    np.testing.assert_allclose(read.hand, np.tile(place, (50, 1)))
    values = {
        "zmp_x": read.zmp[:, 0],
        "grf_x": read.grf[:, 0],
        "grf_z": read.grf[:, 2],
        "hand_x": read.hand[:, 0],
        "hand_z": read.hand[:, 2],
    }
    channels = Channels(values | {"time": frames}, 100.0, 70.0, 1.0, w2=9.0)
    effect = catalogue()["hand_zero"]
    assert effect.columns is not None
    assert effect.force is not None
    np.testing.assert_allclose(effect.columns(channels) @ zero, 9.0 * (read.zmp - true.zmp)[:, 0], rtol=0.02)
    np.testing.assert_allclose(effect.force(channels) @ zero, (true.grf - read.grf)[:, 0] / 70.0, rtol=1e-9)
