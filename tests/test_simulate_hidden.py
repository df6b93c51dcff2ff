"""Hidden effects of the simulators: each is as large as asked, and Newton and Euler hold with it. No model is used."""

import ast
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import plumbline.simulate
from plumbline.physics import G
from plumbline.simulate.control import Controller, Law
from plumbline.simulate.hidden import CONTROL, EFFECTS, OUTSIDE, Setup
from plumbline.simulate.human import Habits, Push, SimulatedTrial, Subject, draw_subject, simulate
from plumbline.simulate.records import Plate

Array = np.ndarray
QUIET = Law(3.0, 0.7, noise=0.0, reference=0.01)
PUSHES = [[Push(0.3, 0.25, 120.0)]]
STEP = 1e-3  # [s] the tests record at 1 kHz


@pytest.fixture(scope="module")
def man() -> Subject:
    return draw_subject("sub-01", 3)


STILL = replace(Controller().forward, noise=0.0)


def _lived(man: Subject, effects: dict[str, Any], law: Law = QUIET, **options: Any) -> SimulatedTrial:
    """2.4 s at 1 kHz without sensor noise and motor noise, one push."""
    settings: dict[str, Any] = {"rate": 1000.0, "marker_noise": 0.0, "force_noise": 0.0, "touches": PUSHES, "duration": 2.4} | options
    return simulate(
        man, trials=1, seed=5, effects=effects, controller=Controller(law, replace(Controller().forward, noise=0.0)), **settings
    )[0]


@pytest.fixture(scope="module")
def plain(man: Subject) -> SimulatedTrial:
    return _lived(man, {})


def _setup() -> Setup:
    return Setup(1, np.random.default_rng(0), Habits(), Controller())


def _net(trial: SimulatedTrial) -> Array:
    """Net lateral CoP of both plates [m]."""
    return sum(p.force[:, 2] * p.cop[:, 0] for p in trial.plates) / sum(p.force[:, 2] for p in trial.plates)


def _away(trial: SimulatedTrial) -> Array:
    """Frames outside the push of the hand."""
    return (trial.time < 0.29) | (trial.time > 0.56)


def test_simulators_of_hidden_effects_import_no_model() -> None:
    """Effects import the simulators and gravity, nothing else of the project."""
    files = list((Path(plumbline.simulate.__file__).parent / "hidden").glob("*.py"))
    assert len(files) >= 5
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("plumbline"):
                assert str(node.module).startswith("plumbline.simulate"), file.name


def test_every_effect_is_found_by_itself() -> None:
    """The catalogue of effects holds each public function once; those of the law and those outside are told apart."""
    assert {"ang_mom", "drift", "com_bias", "delay", "wall", "creep"} <= set(EFFECTS)
    assert {"delay", "lag", "intermittent", "ref_drift", "lopsided"} <= CONTROL
    assert {"wall", "lens", "lopsided"} <= OUTSIDE
    assert not OUTSIDE & {"hand", "gain", "delay"}


# -- forces that no plate measures ------------------------------------------------------------------------------------

CONTACTS: dict[str, tuple[dict[str, Any], Callable[[Array, Array], Array]]] = {
    "hand": ({"k": 200.0, "x": 0.01, "height": 1.0}, lambda x, v: -200.0 * (x - 0.01)),
    "hand_damper": ({"c": 40.0}, lambda x, v: -40.0 * v),
    "wall": ({"k": 2e4, "x": 0.02}, lambda x, v: -2e4 * np.maximum(x - 0.02, 0) ** 2),
    "cubic": ({"k": 2e5}, lambda x, v: -2e5 * x**3),
    "friction": ({"size": 4.0, "speed": 0.05}, lambda x, v: -4.0 * np.tanh(v / 0.05)),
    "magnet": (
        {"size": 9.0, "x": 0.04, "reach": 0.02},
        lambda x, v: -9.0 * (x - 0.04) / 0.02 * np.exp((1 - ((x - 0.04) / 0.02) ** 2) / 2),
    ),
}


@pytest.mark.parametrize("name", CONTACTS)
def test_contacts_pull_as_stated_and_newton_holds(man: Subject, name: str) -> None:
    """m x'' = shear + the stated force of place and speed, outside the push by hand, to 1e-6 N."""
    sizes, law = CONTACTS[name]
    truth = (trial := _lived(man, {name: sizes})).truth
    missing = man.mass * truth["com_ddot_x"] - truth["grf_x"]
    expected = law(truth["com_x"], truth["com_dot_x"])
    free = _away(trial)
    assert np.abs(expected).max() > 0.5
    np.testing.assert_allclose(missing[free], expected[free], atol=1e-6)


def test_a_periodic_force_has_its_size_and_rhythm(man: Subject) -> None:
    """Outside the push the force on the body is a sine of the stated size and frequency."""
    trial = _lived(man, {"periodic": {"size": 7.0, "frequency": 1.2}})
    w, t, free = 2 * np.pi * 1.2, trial.time, _away(trial)
    columns = np.stack([np.sin(w * t), np.cos(w * t)], axis=1)[free]
    found, left, *_ = np.linalg.lstsq(columns, trial.truth["outside_x"][free], rcond=None)
    assert np.hypot(*found) == pytest.approx(7.0, abs=1e-6)
    assert float(left[0]) < 1e-9


@pytest.mark.parametrize("sizes", [{"lateral": 15.0, "height": 1.3}, {"lateral": 0.0, "force": 80.0, "x": 0.3}], ids=["aside", "up"])
def test_a_lean_on_something_balances_about_the_com(man: Subject, sizes: dict[str, float]) -> None:
    """dL/dt about the CoM = moments of ground and contact; the plates carry what the contact does not; it comes and goes in the record."""
    trial = _lived(man, {"push": {"duration": 1.2, **sizes}}, touches=[[]])
    t = trial.truth
    x, z, p = t["com_x"], t["com_z"], t["zmp_x"]
    aside, up = t["outside_x"], man.mass * (t["com_ddot_z"] + G) - t["grf_z"]
    force, at = sizes.get("force", 0.0), sizes.get("x", 0.0)
    assert up.max() == pytest.approx(force, abs=1e-6)
    assert aside.max() == pytest.approx(sizes["lateral"], abs=1e-6)
    assert min(aside[0] + up[0], aside[-1] + up[-1]) < 1e-6
    moment = -z * t["grf_x"] - (p - x) * t["grf_z"] + (sizes.get("height", 0.0) - z) * aside - (at - x) * up
    # the angular momentum has kinks where the acceleration has: the median is of the smooth places
    change = np.gradient(t["ang_mom_y"], STEP)
    assert np.median(np.abs(change - moment)[2:-2]) < 1e-3
    assert np.abs(moment).max() > 0.3


# -- instruments ------------------------------------------------------------------------------------------------------


def _shift(false: SimulatedTrial, true: SimulatedTrial) -> list[Array]:
    """Recorded minus true lateral CoP of each plate [m]."""
    return [a.cop[:, 0] - b.cop[:, 0] for a, b in zip(false.plates, true.plates, strict=True)]


COPS: dict[str, tuple[dict[str, Any], Callable[[Plate, Array], Array]]] = {
    "offset": ({"b": 0.004}, lambda plate, p: 0.004 + 0 * p),
    "drift": ({"c": 0.002}, lambda plate, p: 0.002 * plate.time),
    "gain": ({"q": 0.05}, lambda plate, p: 0.05 * p),
    "crosstalk": ({"height": 0.04}, lambda plate, p: -0.04 * plate.force[:, 0] / plate.force[:, 2]),
    "bent_cop": ({"cubed": 3.0}, lambda plate, p: 3.0 * p**3),
    "hinged_cop": ({"slope": 0.2, "edge": 0.02}, lambda plate, p: 0.2 * np.sign(p) * np.maximum(np.abs(p) - 0.02, 0)),
}


@pytest.mark.parametrize("name", COPS)
def test_faults_of_the_cop_are_as_stated(man: Subject, plain: SimulatedTrial, name: str) -> None:
    """The CoP of each plate is off by the stated amount; forces, free moments, markers and truth are those without it."""
    sizes, law = COPS[name]
    trial, p = _lived(man, {name: sizes}), _net(plain)
    for got, plate, other in zip(_shift(trial, plain), plain.plates, trial.plates, strict=True):
        np.testing.assert_allclose(got, law(plate, p), atol=1e-12)
        np.testing.assert_array_equal(other.force, plate.force)
        if name != "crosstalk":
            np.testing.assert_allclose(other.free_moment, plate.free_moment, atol=1e-9)
    np.testing.assert_array_equal(trial.markers["C7"], plain.markers["C7"])
    np.testing.assert_array_equal(trial.truth["zmp_x"], plain.truth["zmp_x"])


@pytest.mark.parametrize(("name", "vertical"), [("force_scale", 1.04), ("shear_scale", 1.0)])
def test_scaled_forces_leave_the_cop(man: Subject, plain: SimulatedTrial, name: str, vertical: float) -> None:
    """All channels, or the horizontal ones alone, are 1 + s times the truth; the CoP stays."""
    trial = _lived(man, {name: {"s": 0.04}})
    for got, true in zip(trial.plates, plain.plates, strict=True):
        np.testing.assert_allclose(got.force, true.force * np.array([1.04, 1.04, vertical]), atol=1e-9)
        np.testing.assert_allclose(got.cop, true.cop, atol=1e-12)


def test_a_tilted_floor_shows_gravity_in_the_shear(man: Subject, plain: SimulatedTrial) -> None:
    """Tilted by a, the record has x'' - Fx/m = g sin a outside pushes, the markers off by -a z, and the CoP where it was to 0.2 mm."""
    a = 0.008
    trial = _lived(man, {"tilt": {"a": a}})
    shift = trial.markers["C7"] - plain.markers["C7"]
    np.testing.assert_allclose(shift[:, 0], -np.sin(a) * plain.markers["C7"][:, 2], atol=1e-5)
    acceleration = np.cos(a) * plain.truth["com_ddot_x"] - np.sin(a) * plain.truth["com_ddot_z"]
    shear = sum(p.force[:, 0] for p in trial.plates)
    np.testing.assert_allclose((acceleration - shear / man.mass)[_away(plain)], G * np.sin(a), atol=1e-9)
    np.testing.assert_allclose(_net(trial), _net(plain), atol=2e-4)


def _board(force: Array, rate: float = 1000.0) -> Plate:
    """A plate that records the same signal in all channels."""
    wave = np.repeat(force[:, None], 3, axis=1)
    return Plate(np.arange(len(force)) / rate, wave, wave.copy(), np.zeros(3), "right")


def test_a_causal_filter_halves_the_power_at_its_cut_off() -> None:
    """At the cut-off a sine comes out with 1/sqrt 2 of its size, a quarter of a period late; a constant comes out whole from the start."""
    setup, t = _setup(), np.arange(4000) * STEP
    EFFECTS["filter"](setup, cutoff=6.0)
    wave = setup.spoil_plates[0]([_board(np.sin(2 * np.pi * 6.0 * t))])[0].force[2000:, 2]
    np.testing.assert_allclose(wave, -np.cos(2 * np.pi * 6.0 * t[2000:]) / np.sqrt(2), atol=2e-3)
    np.testing.assert_allclose(setup.spoil_plates[0]([_board(np.full(50, 700.0))])[0].moment, 700.0, rtol=1e-9)


def test_creep_adds_a_late_share() -> None:
    """After a step of the load a share of it creeps in with the stated time constant."""
    setup, t = _setup(), np.arange(8000) * STEP
    EFFECTS["creep"](setup, share=0.1, time=1.0)
    step = np.where(t < 2.0, 300.0, 400.0)
    out = setup.spoil_plates[0]([_board(step)])[0].force[:, 2] - step
    assert out[-1] - out[1999] == pytest.approx(10.0 * (1 - np.exp(-6.0)), abs=0.02)
    assert out[2999] - out[1999] == pytest.approx(10.0 * (1 - np.exp(-1.0)), abs=0.02)


def test_com_bias_moves_all_but_the_feet(man: Subject, plain: SimulatedTrial) -> None:
    """Lateral places of all markers but the feet's are (1 + a) x + e0 + pose h^2; the feet and all else stay."""
    trial = _lived(man, {"com_bias": {"scale": 0.05, "e0": 0.003, "pose": 2.0}})
    bend = 0.003 + 2.0 * plain.markers["PELV"][:, 0] ** 2
    for label, place in plain.markers.items():
        moved = 0.0 if label[1:] in ("HEE", "TOE", "MT1", "MT5") else 0.05 * place[:, 0] + bend
        np.testing.assert_allclose(trial.markers[label][:, 0] - place[:, 0], moved, atol=1e-12, err_msg=label)
        np.testing.assert_array_equal(trial.markers[label][:, 1:], place[:, 1:])


def test_a_lens_warps_with_the_cube(man: Subject, plain: SimulatedTrial) -> None:
    """Markers of the trunk are off by cubed h^3, those of the feet are not."""
    trial = _lived(man, {"lens": {"cubed": 4.0}})
    warp = 4.0 * plain.markers["PELV"][:, 0] ** 3
    np.testing.assert_allclose((trial.markers["C7"] - plain.markers["C7"])[:, 0], warp, atol=1e-12)
    np.testing.assert_array_equal(trial.markers["RTOE"], plain.markers["RTOE"])


def test_soft_tissue_swings_behind_the_bone(man: Subject, plain: SimulatedTrial) -> None:
    """n'' + 2 s W n' + W^2 n = -x'' holds for the trunk's markers; those of arms and feet ride on the bone."""
    trial = _lived(man, {"soft_tissue": {"frequency": 4.0, "damping": 0.3}})
    w, x = 2 * np.pi * 4.0, plain.markers["C7"][:, 0]
    n = trial.markers["C7"][:, 0] - x
    rate, change = np.gradient(n, STEP), np.diff(n, 2) / STEP**2
    left = (change + 2 * 0.3 * w * rate[1:-1] + w**2 * n[1:-1] + np.diff(x, 2) / STEP**2)[100:]
    assert np.sqrt(np.mean(left**2)) < 0.02 * np.sqrt(np.mean(change[100:] ** 2))
    assert np.abs(n).max() > 3e-4
    np.testing.assert_array_equal(trial.markers["RWRI"], plain.markers["RWRI"])


# -- laws -------------------------------------------------------------------------------------------------------------


def _late(y: Array, by: float) -> Array:
    steps = round(by / STEP)
    return np.concatenate([np.repeat(y[:1], steps), y[: len(y) - steps]])


def _line(e: Array, v: Array) -> Array:
    return 0.01 + 3.0 * e + 0.7 * v


def _sum(e: Array) -> Array:
    return np.cumsum(e) * STEP


Rule = Callable[[Array, Array, Array], Array]
LAWS: dict[str, tuple[str, dict[str, Any], Rule]] = {
    "soft": ("intermittent", {"half_width": 0.008}, lambda t, e, v: _line(e - np.clip(e, -0.008, 0.008), v)),
    "jump": ("intermittent", {"half_width": 0.008, "zone": "jump"}, lambda t, e, v: _line(np.where(np.abs(e) < 0.008, 0, e), v)),
    "ref_drift": ("ref_drift", {"rate": 0.004}, lambda t, e, v: _line(e - 0.004 * t, v) + 0.004 * t),
    "intrinsic": ("intrinsic", {"kappa": 0.5, "beta": 0.1}, lambda t, e, v: _line(e, v) + 0.5 * e + 0.1 * v),
    "integral": ("integral", {"ki": 0.6}, lambda t, e, v: _line(e, v) + 0.6 * _sum(e)),
    "limits": (
        "limits",
        {"knee": 0.02},
        lambda t, e, v: -0.185 + 0.02 * (np.logaddexp(0, (_line(e, v) + 0.185) / 0.02) - np.logaddexp(0, (_line(e, v) - 0.185) / 0.02)),
    ),
    "rhythm": ("rhythm", {"size": 0.01, "frequency": 0.8}, lambda t, e, v: _line(e, v) - 2.0 * 0.01 * np.sin(2 * np.pi * 0.8 * t)),
    "lopsided": ("lopsided", {"share": 0.4}, lambda t, e, v: _line(e, v) + 1.2 * np.maximum(e, 0)),
    "softening": ("softening", {"bend": 0.15}, lambda t, e, v: _line(e * (1 - (e / 0.15) ** 2), v)),
}


@pytest.mark.parametrize("case", LAWS)
def test_the_zmp_follows_the_changed_law(man: Subject, case: str) -> None:
    """Outside the push the ZMP is what the changed law asks for from the true CoM, to 0.15 mm for 95 % of the time."""
    name, sizes, rule = LAWS[case]
    trial = _lived(man, {name: sizes})
    t = trial.truth
    e, v, free = t["com_x"] - 0.01, t["com_dot_x"], _away(trial)
    miss = np.abs(t["zmp_x"] - np.clip(rule(trial.time, e, v), -0.185, 0.185))
    assert np.quantile(miss[free], 0.95) < 1.5e-4
    straight = np.abs(t["zmp_x"] - np.clip(_line(e, v), -0.185, 0.185))
    assert straight[free].max() > 1e-3


def test_a_held_output_stays_flat_inside_its_zone(man: Subject) -> None:
    """While |e + v / w| is inside the zone the ZMP does not move; outside it is the law's."""
    trial = _lived(man, {"intermittent": {"half_width": 0.012, "zone": "hold"}})
    t, free = trial.truth, _away(trial)
    e, v = t["com_x"] - 0.01, t["com_dot_x"]
    inside = np.abs(e + v / 3.0) < 0.0115
    steady = inside & np.roll(inside, 15) & np.roll(inside, -15) & free
    assert steady.sum() > 300
    assert np.quantile(np.abs(np.gradient(t["zmp_x"], STEP))[steady], 0.9) < 5e-3
    far = free & (np.abs(e + v / 3.0) > 0.015)
    assert np.quantile(np.abs(t["zmp_x"] - np.clip(_line(e, v), -0.185, 0.185))[far], 0.9) < 1.5e-4


def test_intrinsic_stiffness_does_not_wait_for_the_delay(man: Subject) -> None:
    """With a delay the nerves' part is of the old state, the muscles' part of the present one."""
    trial = _lived(man, {"delay": {"delay": 0.06}, "intrinsic": {"kappa": 0.6, "beta": 0.1}}, replace(QUIET, k1=2.0))
    t, free = trial.truth, _away(trial) & (trial.time > 0.2)
    e, v = t["com_x"] - 0.01, t["com_dot_x"]
    law = 0.01 + 2.0 * _late(e, 0.06) + 0.7 * _late(v, 0.06) + 0.6 * e + 0.1 * v
    assert np.quantile(np.abs(t["zmp_x"] - np.clip(law, -0.185, 0.185))[free], 0.95) < 1.5e-4


@pytest.mark.parametrize("clip_last", [False, True])
def test_limits_act_before_or_after_a_lag(man: Subject, clip_last: bool) -> None:
    """T p' + p = the clipped law, or p is the clipped first-order answer to the whole law; with the limits last p leaves them later."""
    low = replace(QUIET, high=0.06)
    trial = _lived(man, {"lag": {"time": 0.1, "clip_last": clip_last}}, low)
    t = trial.truth
    ask = _line(t["com_x"] - 0.01, t["com_dot_x"])
    p = np.empty_like(ask)
    p[0] = ask[0]
    for i in range(1, len(p)):
        goal = ask[i - 1] if clip_last else min(ask[i - 1], 0.06)
        p[i] = p[i - 1] + (1 - np.exp(-STEP / 0.1)) * (goal - p[i - 1])
    assert ask.max() > 0.1
    assert np.quantile(np.abs(t["zmp_x"] - np.minimum(p, 0.06))[_away(trial)], 0.95) < 3e-4


def test_noise_of_the_senses_has_its_size(man: Subject) -> None:
    """What the law asks for beyond the true state is k1 n + k2 n' of a noise n of the stated size."""
    trial = simulate(man, trials=1, duration=20.0, seed=8, rate=200.0, touches=[[]], effects={"sensory": {"sd": 0.003, "time": 0.2}},
                     controller=Controller(QUIET))[0]  # fmt: skip
    t = trial.truth
    left = t["zmp_x"] - _line(t["com_x"] - 0.01, t["com_dot_x"])
    n, step = np.zeros_like(left), 0.005
    for i in range(1, len(n)):  # k2 n' + k1 n = left
        n[i] = n[i - 1] + step / 0.7 * (left[i - 1] - 3.0 * n[i - 1])
    assert np.std(n[400:]) == pytest.approx(0.003, rel=0.3)
