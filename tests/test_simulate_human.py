"""The simulated people obey Newton and Euler, checked segment by segment from their markers, and record what a laboratory would."""

import ast
from pathlib import Path

import ezc3d
import numpy as np
import pytest

import plumbline.simulate
from plumbline.physics import G
from plumbline.simulate.hidden import EFFECTS
from plumbline.simulate.human import (
    Controller,
    Habits,
    Law,
    Lean,
    Push,
    SimulatedTrial,
    Subject,
    Wave,
    draw_subject,
    simulate,
)
from plumbline.simulate.person import ENDS, PAIRED, nominal
from plumbline.simulate.study import marker_set, write_study

CLEAN = {"marker_noise": 0.0, "force_noise": 0.0}
STILL = Controller(Law(noise=0.0), Law(2.0, 0.6, -0.03, 0.12, 0.045, noise=0.0))
#: everything that can move, moves
LIVELY = Habits(
    roll=(Wave(0.06, 0.7, 0.3),),
    pitch=(Wave(0.04, 0.5, 1.0),),
    swing=(Wave(0.3, 0.9, 2.0),),
    sink=(Wave(0.015, 1.1, 0.5),),
    curve=0.8,
    follow=0.4,
)


@pytest.fixture(scope="module")
def man() -> Subject:
    return draw_subject("sub-01", 3)


@pytest.fixture(scope="module")
def lively(man: Subject) -> SimulatedTrial:
    """2 s at 1 kHz, no sensor noise, with a push and with every prescribed motion."""
    options = {"rate": 1000.0, "force_rate": 1000.0, "habits": LIVELY, "touches": [[Push(0.5, 0.25, 150.0)]]}
    return simulate(man, trials=1, duration=2.0, seed=4, **options, **CLEAN)[0]


def _five(x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Value, first and second derivative in the middle of the five 1 ms samples that lie within one 5 ms step of the motion."""
    y = [x[i : len(x) - 6 + i : 5] for i in range(5)]
    first = (y[0] - 8 * y[1] + 8 * y[3] - y[4]) / 12e-3
    second = (-y[0] + 16 * y[1] - 30 * y[2] + 16 * y[3] - y[4]) / 12e-6
    return y[2], first, second


def _segments(trial: SimulatedTrial) -> list[tuple[float, float, np.ndarray, np.ndarray]]:
    """Mass, gyration radius over length squared, and the proximal and distal markers of the fourteen segments."""
    out = []
    for name, (near, far) in ENDS.items():
        row = trial.subject.segments[name]
        for side in ("R", "L") if name in PAIRED else ("",):
            ends = trial.markers[side + near], trial.markers[side + far]
            out.append((trial.subject.mass * row.mass, row.gyration, ends[0] + row.com * (ends[1] - ends[0]), ends[1] - ends[0]))
    return out


def _newton_euler(trial: SimulatedTrial) -> tuple[np.ndarray, np.ndarray]:
    """Force [N] and moment about the origin [N m] from sums over segments, markers differentiated within the steps."""
    force, moment = 0.0, 0.0
    for mass, gyration, com, along in _segments(trial):
        r, _, a = _five(com)
        u, _, change = _five(along)
        lift = mass * (a + np.array([0.0, 0.0, G]))
        force = force + lift
        moment = moment + np.cross(r, lift) + mass * gyration**2 * np.cross(u, change)
    return force, moment


def _ground(trial: SimulatedTrial) -> tuple[np.ndarray, np.ndarray]:
    """Sum of both plates' forces [N] and of their moments about the origin [N m]."""
    force = sum(p.force for p in trial.plates)
    return force, sum(p.moment + np.cross(p.centre, p.force) for p in trial.plates)


def test_simulators_import_nothing_of_the_project_but_gravity() -> None:
    """Truth is independent: the simulators import each other and G, no model, effect or stage."""
    for file in Path(plumbline.simulate.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0
                names = [f"{node.module}.{a.name}" for a in node.names]
            for name in (n for n in names if n.startswith("plumbline")):
                assert name.startswith("plumbline.simulate") or name == "plumbline.physics.G", f"{file.name}: {name}"


def test_fourteen_segments_weigh_one_body() -> None:
    """Mass shares of both sexes' tables, and of a person who deviates, sum to one."""
    for rows in (nominal("M"), nominal("F"), draw_subject("sub-01", 5, personal=0.08).segments):
        assert sum(row.mass * (2 if name in PAIRED else 1) for name, row in rows.items()) == pytest.approx(1.0, abs=1e-12)
    person = draw_subject("sub-01", 5, personal=0.08)
    assert person.segments["trunk"] != person.nominal["trunk"] == nominal("M")["trunk"]


def test_mass_times_acceleration_is_all_forces(lively: SimulatedTrial) -> None:
    """m a_CoM = GRF + push + m g, to 1e-9 in the truth and 1e-5 N with accelerations from the fourteen segments' markers."""
    t, mass = lively.truth, lively.subject.mass
    force, _ = _ground(lively)
    total = force + np.stack([t["outside_x"], 0 * t["time"], 0 * t["time"] - mass * G], axis=1)
    for i, axis in enumerate("xyz"):
        np.testing.assert_allclose(mass * t[f"com_ddot_{axis}"], total[:, i], atol=1e-9)
    measured, _ = _newton_euler(lively)
    push = np.stack([t["outside_x"], 0 * t["time"], 0 * t["time"]], axis=1)
    np.testing.assert_allclose(measured, _five(force + push)[0], atol=1e-5)


def test_moments_balance_about_any_axis(lively: SimulatedTrial) -> None:
    """Outside the push, the sum of m r x (a - g) and the segments' own spin is the plates' moment about the origin."""
    _, moment = _newton_euler(lively)
    push = _five(lively.truth["outside_x"])[0]
    np.testing.assert_allclose(moment[push == 0], _five(_ground(lively)[1])[0][push == 0], atol=1e-5)
    # during the push what is missing turns about the forward axis like a force at the height of the hand
    pushed = np.abs(push) > 1.0
    height = (moment - _five(_ground(lively)[1])[0])[pushed, 1] / push[pushed]
    s = lively.subject
    hand = _five(lively.markers["PELV"] + s.push * (lively.markers["C7"] - lively.markers["PELV"]))[0][pushed, 2]
    np.testing.assert_allclose(height, hand, atol=1e-5)


def test_angular_momentum_changes_by_the_moments_about_the_com(lively: SimulatedTrial) -> None:
    """dL/dt about the CoM = moments of the plates about the CoM where nobody pushes, to 1e-6 N m."""
    t = lively.truth
    spin = np.stack([t[f"ang_mom_{a}"] for a in "xyz"], axis=1)
    com = np.stack([t[f"com_{a}"] for a in "xyz"], axis=1)
    force, moment = _ground(lively)
    about = _five(moment - np.cross(com, force))[0]
    quiet = _five(t["outside_x"])[0] == 0
    assert np.abs(about[quiet]).max() > 5.0
    np.testing.assert_allclose(_five(spin)[1][quiet], about[quiet], atol=1e-6)


def test_truth_of_com_and_angular_momentum_is_that_of_the_segments(lively: SimulatedTrial) -> None:
    """CoM and angular momentum in the truth table are the sums over the marker segments."""
    parts = _segments(lively)
    com = sum(m * r for m, _, r, _ in parts) / lively.subject.mass
    velocity = sum(m * _five(r)[1] for m, _, r, _ in parts) / lively.subject.mass
    spin = np.zeros_like(velocity)
    for mass, gyration, r, along in parts:
        u, rate, _ = _five(along)
        spin += mass * np.cross(_five(r - com)[0], _five(r)[1] - velocity) + mass * gyration**2 * np.cross(u, rate)
    for i, axis in enumerate("xyz"):
        np.testing.assert_allclose(com[:, i], lively.truth[f"com_{axis}"], atol=1e-12)
        np.testing.assert_allclose(spin[:, i], _five(lively.truth[f"ang_mom_{axis}"])[0], atol=1e-7)


def test_net_cop_is_exact_and_each_foot_carries_its_own(lively: SimulatedTrial, man: Subject) -> None:
    """The load-weighted CoP is the ZMP; each CoP is within its foot's width and length and no load is negative."""
    load = sum(p.force[:, 2] for p in lively.plates)
    for i, name in enumerate(("zmp_x", "zmp_y")):
        net = sum(p.cop[:, i] * p.force[:, 2] for p in lively.plates) / load
        np.testing.assert_allclose(net, lively.truth[name], atol=1e-12)
    for plate, middle in zip(lively.plates, (man.stance, -man.stance), strict=True):
        assert np.abs(plate.cop[:, 0] - middle).max() <= man.foot_width
        assert plate.cop[:, 1].min() > -man.heel
        assert plate.cop[:, 1].max() < man.lengths["foot"] - man.heel
        assert plate.force[:, 2].min() >= 0
        np.testing.assert_allclose(plate.cop[:, 2], 0.0)


def test_bones_keep_their_length_and_knees_bend_forward(lively: SimulatedTrial, man: Subject) -> None:
    """Each segment's markers keep their distance; knees stay ahead of the line from hip to ankle; feet do not move."""
    for name, (near, far) in ENDS.items():
        for side in ("R", "L") if name in PAIRED else ("",):
            length = np.linalg.norm(lively.markers[side + far] - lively.markers[side + near], axis=1)
            np.testing.assert_allclose(length, length[0], atol=1e-12)
            if name != "foot":
                assert length[0] == pytest.approx(man.lengths[name], abs=1e-12)
    for side in "RL":
        assert (lively.markers[side + "KNE"][:, 1] > lively.markers[side + "HIP"][:, 1] + 0.02).all()
        assert np.ptp(lively.markers[side + "TOE"], axis=0).max() == 0


def test_knees_hold_through_a_fall_of_short_and_tall() -> None:
    """Legs are never longer than their bones, for people from 1.45 to 2.05 m, falling with bouncing knees."""
    touches = [[Push(0.2, 0.25, 600.0)], [Push(0.2, 0.25, -600.0)]] * 2
    people = [draw_subject("sub-01", 6, mass=70.0, height=h, sex=sex) for h, sex in ((1.45, "F"), (2.05, "M"))]
    for trial in simulate(people, trials=2, duration=2.0, seed=1, effects={"height": {}}, touches=touches, **CLEAN):
        assert trial.fell
        for side in "RL":
            leg = np.linalg.norm(trial.markers[side + "HIP"] - trial.markers[side + "ANK"], axis=1)
            assert leg.max() < trial.subject.lengths["thigh"] + trial.subject.lengths["shank"] - 1e-3


def test_at_rest_the_com_stays_over_the_zmp(man: Subject) -> None:
    """Without noise and pushes nobody moves, and the ZMP is under the CoM."""
    trial = simulate(man, trials=1, duration=3.0, seed=1, controller=STILL, touches=[[]], **CLEAN)[0]
    for a in "xy":
        assert np.ptp(trial.truth[f"com_{a}"]) < 1e-12
        np.testing.assert_allclose(trial.truth[f"zmp_{a}"], trial.truth[f"com_{a}"], atol=1e-12)
    assert trial.truth["com_y"][0] == pytest.approx(0.045, abs=1e-12)


def test_mirrored_pushes_give_mirrored_records(man: Subject) -> None:
    """With all pushes to the other side, markers and forces are the mirror image, sides exchanged."""
    touches = [[Push(1.0, 0.25, 150.0), Lean(3.0, 2.4, 0.28, 0.4)], [Push(1.0, 0.25, -150.0), Lean(3.0, 2.4, -0.28, 0.4)]]
    options = {"effects": {"hand": {"k": 80.0}}, "habits": Habits(follow=0.3, curve=0.5), "controller": STILL}
    here, there = simulate(man, trials=2, duration=6.0, seed=1, touches=touches, force_rate=200.0, **options, **CLEAN)
    for label, place in here.markers.items():
        other = {"R": "L", "L": "R"}.get(label[0], label[0]) + label[1:]
        np.testing.assert_allclose(there.markers[other] * [-1, 1, 1], place, atol=1e-9)
    for right, left in zip(here.plates, there.plates[::-1], strict=True):
        np.testing.assert_allclose(left.force * [-1, 1, 1], right.force, atol=1e-7)
        np.testing.assert_allclose(left.moment * [1, -1, -1], right.moment, atol=1e-7)


def test_zmp_follows_the_clipped_law(man: Subject) -> None:
    """Outside pushes the measured ZMP is the law's, to 0.05 mm for 99 % of the time, and never past the limits by 2 mm."""
    for trial in simulate(man, trials=5, duration=8.0, seed=2, controller=STILL, force_rate=200.0, **CLEAN):
        t, free = trial.truth, np.ones(len(trial.time), bool)
        for touch in trial.touches:
            free &= (t["time"] < touch.onset - 0.01) | (t["time"] > touch.onset + touch.duration + 0.01)
        for axis, law in (("x", STILL.lateral), ("y", STILL.forward)):
            ask = law.reference + law.k1 * (t[f"com_{axis}"] - law.reference) + law.k2 * t[f"com_dot_{axis}"]
            miss = np.abs(t[f"zmp_{axis}"] - np.clip(ask, law.low, law.high))[free]
            assert np.percentile(miss, 99) < 5e-5
            assert miss.max() < 2e-3
            assert t[f"zmp_{axis}"].min() > law.low - 2e-3
            assert t[f"zmp_{axis}"].max() < law.high + 2e-3


def test_both_axes_are_alive_and_noise_has_its_size(man: Subject) -> None:
    """Quiet standing sways in both directions; what is left of the law is motor noise of the stated size."""
    trials = simulate(man, trials=24, duration=7.0, seed=5, force_rate=200.0, touches=[[]] * 24, **CLEAN)
    for axis, law in (("x", Controller().lateral), ("y", Controller().forward)):
        sway = np.concatenate([t.truth[f"com_{axis}"] for t in trials])
        assert 3e-4 < sway.std() < 5e-3
        rest = [
            t.truth[f"zmp_{axis}"] - law.reference - law.k1 * (t.truth[f"com_{axis}"] - law.reference)
            - law.k2 * t.truth[f"com_dot_{axis}"] for t in trials
        ]  # fmt: skip
        assert np.concatenate(rest).std() == pytest.approx(law.noise, rel=0.12)


def _weak_omega2(trials: list[SimulatedTrial], half: float = 0.4) -> float:
    """w2 of x'' = w2 (x - p) + c from the noise-free truth, by test functions (1 - s^2)^4 that touch no push."""
    rows = []
    for trial in trials:
        t = trial.truth
        step = t["time"][1]
        n = round(half / step)
        s = np.arange(-n, n + 1) / n
        bump = (1 - s**2) ** 4 * step
        second = (48 * s**2 * (1 - s**2) ** 2 - 8 * (1 - s**2) ** 3) / half**2 * step
        for k in range(n, len(s) // 4 * (len(t["time"]) // (len(s) // 4)) - n, n // 2):
            near = slice(k - n, k + n + 1)
            if not np.any(t["outside_x"][near]):
                rows.append((second @ t["com_x"][near], bump @ (t["com_x"] - t["zmp_x"])[near], bump.sum()))
    a = np.array(rows)
    return float(np.linalg.lstsq(a[:, 1:], a[:, 0], rcond=None)[0][0])


def test_leaning_legs_make_w2_smaller_though_nothing_is_hidden(man: Subject) -> None:
    """Legs lean under an upright trunk: w2 is 5 to 15 % below g/z; a trunk that leans with them takes it further down."""
    upright = simulate(man, trials=4, duration=7.0, seed=6, force_rate=200.0, **CLEAN)
    leaning = simulate(man, trials=4, duration=7.0, seed=6, force_rate=200.0, habits=Habits(follow=1.0), **CLEAN)
    ratios = [_weak_omega2(run) / (G / np.mean(run[0].truth["com_z"])) for run in (upright, leaning)]
    assert 0.85 < ratios[0] < 0.95
    assert ratios[1] < ratios[0] - 0.05


def test_recoveries_returns_from_beyond_and_falls_occur() -> None:
    """Five runs hold all kinds of loci: the fourth ends in a fall, in the fifth the CoM is let go beyond the limit and returns."""
    people = [draw_subject(f"sub-0{i}", i, sex=sex) for i, sex in ((1, "M"), (2, "F"), (3, "F"))]
    everything = simulate(people, trials=5, duration=11.0, seed=1, rate=100.0)
    for runs in (everything[:5], everything[5:10], everything[10:]):
        assert [t.fell for t in runs] == [False, False, False, True, False]
        fall, lean = runs[3], runs[4]
        assert 0.28 < abs(fall.truth["com_x"][-1]) <= 0.3
        assert fall.time[-1] < 11.0
        assert len(fall.plates[0].time) == len(fall.time) * 10
        let_go = int((lean.touches[0].onset + lean.touches[0].duration) * 100) + 1
        x, v = lean.truth["com_x"][let_go], lean.truth["com_dot_x"][let_go]
        assert abs(x) > 0.185 > 0 > x * v
        assert abs(lean.truth["com_x"][let_go + 250]) < 0.05


def test_angular_momentum_effect_moves_the_trunk_as_stated(man: Subject) -> None:
    """'ang_mom' rolls the trunk with the stated amplitude and frequency on top of a posture that is otherwise upright."""
    effects = {"ang_mom": {"amplitude": 0.05, "frequency": 0.65}}
    plain, rolled = (simulate(man, trials=1, duration=3.0, seed=7, effects=e, **CLEAN)[0] for e in ({}, effects))
    for trial, size in ((plain, 0.0), (rolled, 0.05)):
        trunk = trial.markers["C7"] - trial.markers["PELV"]
        roll = np.arctan2(trunk[:, 0], trunk[:, 2])
        t = trial.time
        waves = np.stack([np.sin(2 * np.pi * 0.65 * t), np.cos(2 * np.pi * 0.65 * t)], axis=1)
        fit = np.linalg.lstsq(waves, roll, rcond=None)[0]
        np.testing.assert_allclose(roll, waves @ fit, atol=1e-9)
        assert np.hypot(*fit) == pytest.approx(size, abs=1e-9)


def test_height_effect_bounces_and_sinks_as_stated(man: Subject) -> None:
    """'height' lowers the hips by amplitude (1 + sin) and 0.8 x^2 below the place they have without it."""
    trial = simulate(man, trials=1, duration=3.0, seed=8, effects={"height": {}}, **CLEAN)[0]
    hips, t = trial.markers["PELV"], trial.time
    top = man.ankle + np.sqrt(man.leg**2 - hips[:, 0] ** 2 - hips[:, 1] ** 2)
    bounce = top - hips[:, 2] - 0.8 * hips[:, 0] ** 2
    waves = np.stack([np.sin(2 * np.pi * t), np.cos(2 * np.pi * t), np.ones_like(t)], axis=1)
    fit = np.linalg.lstsq(waves, bounce, rcond=None)[0]
    np.testing.assert_allclose(bounce, waves @ fit, atol=1e-9)
    assert (np.hypot(*fit[:2]), fit[2]) == (pytest.approx(0.017), pytest.approx(0.017))


def test_sync_effect_records_the_force_late(man: Subject) -> None:
    """With 'sync' of 16 ms the plates hold at t what the feet felt at t - 16 ms; the motion is the same."""
    plain, late = (simulate(man, trials=1, duration=4.0, seed=9, effects=e, **CLEAN)[0] for e in ({}, {"sync": {"delay": 0.016}}))
    for a, b in zip(plain.plates, late.plates, strict=True):
        np.testing.assert_allclose(b.force[16:], a.force[:-16], atol=1e-9)
    np.testing.assert_array_equal(plain.truth["com_x"], late.truth["com_x"])


def test_delay_effect_acts_on_the_old_state(man: Subject) -> None:
    """With 'delay' of 80 ms the ZMP outside pushes is the clipped law of the CoM 80 ms earlier."""
    controller = Controller(Law(2.5, 0.75, noise=0.0), STILL.forward)
    trial = simulate(man, trials=1, duration=5.0, seed=10, effects={"delay": {"delay": 0.08}}, controller=controller, **CLEAN)[0]
    t = trial.truth
    free = t["time"][16:] > trial.touches[0].onset + 0.26
    law = np.clip(2.5 * t["com_x"][:-16] + 0.75 * t["com_dot_x"][:-16], -0.185, 0.185)
    miss = np.abs(t["zmp_x"][16:] - law)[free]
    assert np.percentile(miss, 99) < 5e-5
    assert np.abs(t["zmp_x"][16:] - np.clip(2.5 * t["com_x"][16:] + 0.75 * t["com_dot_x"][16:], -0.185, 0.185))[free].max() > 0.02


def test_lag_smooths_the_wanted_zmp(man: Subject) -> None:
    """With a lag T the ZMP obeys T p' + p = the clipped law."""
    controller = Controller(Law(3.0, 0.8, noise=0.0), STILL.forward, lag=0.06)
    trial = simulate(man, trials=1, duration=5.0, seed=11, controller=controller, **CLEAN)[0]
    t = trial.truth
    p, slope = t["zmp_x"][1:-1], (t["zmp_x"][2:] - t["zmp_x"][:-2]) / 0.01
    law = np.clip(3.0 * t["com_x"] + 0.8 * t["com_dot_x"], -0.185, 0.185)[1:-1]
    free = t["time"][1:-1] > trial.touches[0].onset + 0.27
    assert np.percentile(np.abs(0.06 * slope + p - law)[free], 98) < 1e-4
    assert np.abs(p - law)[free].max() > 0.02


def test_offset_effect_shifts_the_recorded_cop_only(man: Subject) -> None:
    """'offset' b moves each plate's CoP by b; forces, free moment and truth stay."""
    plain, moved = (
        simulate(man, trials=1, duration=2.0, seed=12, effects=e, **CLEAN)[0] for e in ({}, {"offset": {"b": 0.005, "forward": -0.002}})
    )
    for a, b in zip(plain.plates, moved.plates, strict=True):
        np.testing.assert_allclose(b.cop - a.cop, np.broadcast_to([0.005, -0.002, 0.0], a.cop.shape), atol=1e-12)
        np.testing.assert_allclose(b.free_moment, a.free_moment, atol=1e-9)
        np.testing.assert_array_equal(b.force, a.force)
    np.testing.assert_array_equal(plain.truth["zmp_x"], moved.truth["zmp_x"])


def test_hand_effect_is_a_spring_no_plate_sees(man: Subject) -> None:
    """'hand' pulls with -k (x - place): the force that plates and CoM disagree by, also the only one outside pushes."""
    trial = simulate(man, trials=1, duration=5.0, seed=13, effects={"hand": {"k": 120.0, "x": 0.02}}, touches=[[]], **CLEAN)[0]
    t = trial.truth
    missing = man.mass * t["com_ddot_x"] - t["grf_x"]
    np.testing.assert_allclose(missing, -120.0 * (t["com_x"] - 0.02), atol=1e-9)
    np.testing.assert_allclose(missing, t["outside_x"], atol=1e-9)


def test_sensor_noise_has_its_size(man: Subject) -> None:
    """Recorded minus noise-free markers and plates have the stated standard deviations."""
    clean = simulate(man, trials=1, duration=5.0, seed=14, **CLEAN)[0]
    noisy = simulate(man, trials=1, duration=5.0, seed=14, marker_noise=0.7e-3, force_noise=1.5)[0]
    spots = np.stack([noisy.markers[m] - clean.markers[m] for m in clean.markers])
    assert spots.std() == pytest.approx(0.7e-3, rel=0.01)
    for a, b in zip(clean.plates, noisy.plates, strict=True):
        assert (b.force - a.force).std() == pytest.approx(1.5, rel=0.02)
        assert (b.moment - a.moment).std() == pytest.approx(0.45, rel=0.02)


def test_a_trial_does_not_depend_on_who_else_is_simulated(man: Subject) -> None:
    """A subject's trials are the same alone and beside another subject; another seed gives others."""
    other = draw_subject("sub-02", 8, sex="F")
    alone = simulate(man, trials=2, duration=2.0, seed=15)
    beside = simulate([man, other], trials=2, duration=2.0, seed=15)
    for a, b in zip(alone, beside[:2], strict=True):
        for label in a.markers:
            np.testing.assert_allclose(a.markers[label], b.markers[label], atol=1e-12)
    assert not np.allclose(alone[0].markers["C7"], simulate(man, trials=1, duration=2.0, seed=16)[0].markers["C7"], atol=1e-3)


def test_what_cannot_be_simulated_is_refused(man: Subject) -> None:
    """Unknown effects, limits off the feet and a wrong number of push lists stop with the names and numbers."""
    with pytest.raises(ValueError, match=r"no hidden effect is called 'angmom'; there are ang_mom"):
        simulate(man, trials=1, duration=1.0, seed=1, effects={"angmom": {}})
    with pytest.raises(ValueError, match=r"sub-01: ZMP limits -0.185, 0.3 m .* do not lie under the feet"):
        simulate(man, trials=1, duration=1.0, seed=1, controller=Controller(Law(high=0.3)))
    with pytest.raises(ValueError, match="1 lists for 2 trials"):
        simulate(man, trials=2, duration=1.0, seed=1, touches=[[]])
    with pytest.raises(ValueError, match=r"0\.002 s is shorter than the integration step"):
        simulate(man, trials=1, duration=1.0, seed=1, effects={"delay": {"delay": 0.002}})
    assert set(EFFECTS) >= {"ang_mom", "height", "sync", "delay", "offset", "hand"}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory, man: Subject) -> tuple[Path, list[SimulatedTrial]]:
    folder = tmp_path_factory.mktemp("study")
    options = {"trials": 2, "duration": 3.0, "seed": 20, "quiet": True}
    return folder, write_study(folder, [man, draw_subject("sub-02", 9)], truth_folder=folder / "truth", **options)


def test_study_on_disk_has_the_layout_of_a_study(study: tuple[Path, list[SimulatedTrial]]) -> None:
    """raw/ holds participants, marker set, one C3D per trial and events where somebody pushed; the truth lies outside."""
    folder, trials = study
    names = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    for subject in ("sub-01", "sub-02"):
        for name in ("task-lateral_run-01", "task-lateral_run-02", "task-quiet_run-01"):
            assert f"raw/{subject}/{subject}_{name}.c3d" in names
            assert f"truth/{subject}_{name}.parquet" in names
            assert (f"raw/{subject}/{subject}_{name}_events.tsv" in names) == ("lateral" in name)
    assert len(names) == 2 + 2 * (3 + 3 + 2) == 2 + len(trials) * 2 + 4
    onset, duration, kind = (folder / "raw/sub-01/sub-01_task-lateral_run-01_events.tsv").read_text().splitlines()[1].split("\t")
    assert (float(onset), float(duration), kind) == (trials[0].touches[0].onset, 0.25, "push")


def test_c3d_says_what_was_simulated(study: tuple[Path, list[SimulatedTrial]]) -> None:
    """Markers come back in mm to float precision; the reader's own plate helper finds the CoP of each plate."""
    folder, trials = study
    c = ezc3d.c3d(str(folder / "raw/sub-01/sub-01_task-lateral_run-02.c3d"), extract_forceplat_data=True)
    trial = trials[1]
    assert c["parameters"]["POINT"]["UNITS"]["value"] == ["mm"]
    for i, label in enumerate(c["parameters"]["POINT"]["LABELS"]["value"]):
        np.testing.assert_allclose(c["data"]["points"][:3, i].T / 1e3, trial.markers[label], atol=1e-6)
    for helper, plate in zip(c["data"]["platform"], trial.plates, strict=True):
        np.testing.assert_allclose(helper["center_of_pressure"].T[:, :2] / 1e3, plate.cop[:, :2], atol=1e-5)
        # the format holds the action on the plate, so that the helper's force is the reaction with its sign turned
        np.testing.assert_allclose(helper["force"].T, -plate.force, atol=1e-3)


def test_marker_set_gives_the_true_com(study: tuple[Path, list[SimulatedTrial]], man: Subject) -> None:
    """Its segments weigh one body and, with markers free of noise, give the true CoM exactly; not so with a personal deviation."""
    rows = [line for line in marker_set([man]).splitlines() if "proximal: [" in line]
    assert (study[0] / "raw/markerset.yaml").read_text().count("proximal: [") == len(rows) == 14
    for person, exact in ((man, True), (draw_subject("sub-01", 3, personal=0.05), False)):
        trial = simulate(person, trials=1, duration=1.0, seed=21, **CLEAN)[0]
        com, whole = np.zeros((len(trial.time), 3)), 0.0
        for line in rows:
            near, far = (line.split(f"{end}: [")[1].split("]")[0] for end in ("proximal", "distal"))
            mass, share = (float(line.split(f"{key}: ")[1].split(",")[0]) for key in ("mass", "com"))
            com += mass * (trial.markers[near] + share * (trial.markers[far] - trial.markers[near]))
            whole += mass
        miss = np.abs(com[:, 2] - trial.truth["com_z"]).max()
        assert whole == pytest.approx(1.0, abs=1e-7)
        assert (miss < 1e-7) if exact else (miss > 1e-3)


def test_c3d_refuses_rates_it_cannot_hold(man: Subject, tmp_path: Path) -> None:
    """Plates at 500 Hz beside markers at 200 Hz are refused with both rates, as a C3D frame holds whole samples."""
    with pytest.raises(ValueError, match=r"at 500.0 Hz do not make a whole number in each of 201 frames at 200.0 Hz"):
        write_study(tmp_path, [man], trials=1, duration=1.0, force_rate=500.0, seed=1)


def test_a_seed_writes_the_same_bytes(study: tuple[Path, list[SimulatedTrial]], man: Subject, tmp_path: Path) -> None:
    """Every file below raw/ is byte for byte the same in a second run."""
    write_study(tmp_path, [man, draw_subject("sub-02", 9)], trials=2, duration=3.0, seed=20, quiet=True)
    first, second = ({p.relative_to(f): p.read_bytes() for p in (f / "raw").rglob("*.*")} for f in (study[0], tmp_path))
    assert first == second
    assert len(first) == 2 + 2 * (3 + 2)


def test_truth_may_not_lie_in_raw(man: Subject, tmp_path: Path) -> None:
    """A truth folder below raw/ is refused before anything is simulated."""
    with pytest.raises(ValueError, match="the truth may not lie in"):
        write_study(tmp_path, [man], trials=1, seed=1, truth_folder=tmp_path / "raw" / "truth")
    assert not (tmp_path / "raw").exists()
