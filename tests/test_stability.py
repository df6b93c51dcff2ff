"""Extrapolated CoM and margin of stability: an inverted pendulum comes back from inside, and falls from outside."""

import numpy as np
import pandas as pd
import pytest

from plumbline.errors import PlumblineError
from plumbline.models import stability
from plumbline.physics import G
from plumbline.stability import stability as stage
from plumbline.tables import TABLES

Array = np.ndarray

LOW, HIGH, OMEGA = -0.05, 0.12, 3.2  # [m], [m], [rad/s]


def pendulum(x: float, v: float, p: float, t: Array, omega: float = OMEGA) -> tuple[Array, Array]:
    """Closed form of x'' = w2 (x - p) with a constant p: place [m] and speed [m/s]."""
    c, s = np.cosh(omega * t), np.sinh(omega * t)
    return p + (x - p) * c + v / omega * s, (x - p) * omega * s + v * c


@pytest.mark.parametrize("x", [-0.2, 0.0, 0.1])
@pytest.mark.parametrize("v", [-0.5, 0.0, 0.6])
def test_a_pendulum_on_its_capture_point_comes_to_rest_there(x: float, v: float) -> None:
    """With the CoP at x + v/w the CoM ends over it, from wherever and however fast."""
    xi = stability.extrapolated(np.array([x]), np.array([v]), OMEGA)[0]
    end, speed = pendulum(x, v, xi, np.array([6.0]))
    assert end[0] == pytest.approx(xi, abs=1e-6)
    assert abs(speed[0]) < 1e-5


def test_the_extrapolated_com_runs_away_from_the_cop() -> None:
    """xi' = w (xi - p): its distance from a CoP that stays grows as exp(w t), whatever x and x' are apart."""
    t = np.linspace(0.0, 1.0, 50)
    x, v = pendulum(0.03, -0.25, 0.01, t)
    xi = stability.extrapolated(x, v, OMEGA)
    np.testing.assert_allclose(xi - 0.01, (xi[0] - 0.01) * np.exp(OMEGA * t), atol=1e-12)


@pytest.mark.parametrize(("v", "returns"), [(0.35, True), (0.45, False)])
def test_inside_returns_and_outside_falls(v: float, returns: bool) -> None:
    """At the same place, the speed at which xi passes the border decides: with the CoP at that border it comes back, or it falls."""
    x = 0.0
    xi = stability.extrapolated(np.array([x]), np.array([v]), OMEGA)
    assert bool(stability.margin(xi, LOW, HIGH)[0] > 0) is returns
    place, speed = pendulum(x, v, HIGH, np.array([1.5]))
    assert bool(speed[0] < 0) is returns
    assert bool(place[0] < HIGH) is returns


def test_released_at_rest_the_margin_is_that_of_the_com() -> None:
    """At rest xi is the CoM: leant inside the border it returns, outside it falls, at every omega."""
    for omega in (2.0, 3.2, 4.5):
        for x, inside in ((0.11, True), (0.13, False)):
            xi = stability.extrapolated(np.array([x]), np.zeros(1), omega)
            assert xi[0] == x
            assert bool(stability.margin(xi, LOW, HIGH)[0] > 0) is inside
            assert bool(pendulum(x, 0.0, HIGH, np.array([1.0]), omega)[1][0] < 0) is inside


def test_the_missing_step_saves() -> None:
    """With the border moved by the step the pendulum comes to rest; with less it falls; inside no step is asked for."""
    xi = np.array([LOW - 0.07, 0.0, HIGH + 0.04])
    missing = stability.step(xi, LOW, HIGH)
    np.testing.assert_allclose(missing, [-0.07, 0.0, 0.04])
    v = (xi[2] - 0.02) * OMEGA
    assert pendulum(0.02, v, HIGH + missing[2] + 1e-3, np.array([4.0]))[1][0] < 0
    assert pendulum(0.02, v, HIGH + missing[2] - 1e-3, np.array([4.0]))[1][0] > 0


@pytest.mark.parametrize("turn", [1, -1])
def test_an_outline_agrees_with_borders(turn: int) -> None:
    """In a box, drawn in either turn, the margin in the outline is the smaller of both axes' margins."""
    corners = np.array([[-0.2, -0.05], [0.2, -0.05], [0.2, 0.12], [-0.2, 0.12]])[::turn]
    xi = np.random.default_rng(3).uniform(-0.3, 0.3, (200, 2))
    both = np.minimum(stability.margin(xi[:, 0], -0.2, 0.2), stability.margin(xi[:, 1], -0.05, 0.12))
    np.testing.assert_allclose(stability.margin_in(xi, corners), both, atol=1e-12)


def test_omega_is_that_of_a_point_mass() -> None:
    """omega is sqrt(g/z) at rest, larger while pushed up, unknown in free fall; a lower CoM has a larger one and a nearer xi."""
    z = np.array([1.0, 0.8])
    omega = stability.natural(z)
    np.testing.assert_allclose(omega**2 * z, G)
    assert np.isnan(stability.natural(z, -G - 1.0)).all()
    assert (stability.natural(z, 1.0) > omega).all()
    xi = stability.extrapolated(np.zeros(2), np.full(2, 0.3), omega)
    assert xi[1] < xi[0]
    with pytest.raises(PlumblineError, match="positive"):
        stability.extrapolated(np.zeros(1), np.zeros(1), 0.0)


def test_speed_of_a_parabola_is_exact() -> None:
    """The slope of a parabola is exact, ends are unknown, and white noise is as small as stated."""
    t = np.arange(200) / 100.0
    found = stability.speed(0.3 * t - 0.2 * t**2, t, 0.1)
    np.testing.assert_allclose(found[10:-10], (0.3 - 0.4 * t)[10:-10], atol=1e-12)
    assert np.isnan(found[[0, 9, -10, -1]]).all()
    noise = np.random.default_rng(7).normal(0.0, 1e-3, 20000)
    sd = np.nanstd(stability.speed(noise, np.arange(20000) / 100.0, 0.1))
    assert sd == pytest.approx(1e-3 * np.sqrt(3 / (21 * 0.1**2)), rel=0.1)


def frames(borders: float = 0.1) -> pd.DataFrame:
    """Somebody who sways sideways by 20 mm at 0.5 Hz; the own CoM is 0.1 m lower than the table's; plates at 0.05 m."""
    t = np.arange(500) / 100.0
    x = 0.02 * np.sin(np.pi * t)
    out = {"trial": "a", "subject": "sub-01", "task": "sway", "condition": "", "frame": np.arange(500), "time": t, "zmp_z": 0.05}
    for name, z in (("table", 1.05), ("lab", np.nan), ("sesc", 0.95)):
        out |= {f"com_{name}_x": x, f"com_{name}_y": 0.0 * t, f"com_{name}_z": z}
    out |= {"limit_left": -borders, "limit_right": borders, "limit_back": -np.nan, "limit_front": np.nan}
    return pd.DataFrame(out)


def test_each_com_has_its_own_omega_and_margin() -> None:
    """Amplitude of the extrapolated CoM is A sqrt(1 + (2 pi f/omega)^2); a lower CoM is nearer; borders not known leave no margin."""
    tables = stage(frames())
    assert {name: set(t.columns) for name, t in tables.items()} == {n: {c.name for c in TABLES[n]} for n in ("stability", "margins")}
    by = tables["margins"].set_index("method")
    assert list(by.index) == ["table", "sesc"]
    for method, height in (("table", 1.0), ("sesc", 0.9)):
        omega = np.sqrt(G / height)
        assert by.loc[method, "omega"] == pytest.approx(omega)
        reach = 0.02 * np.sqrt(1.0 + (np.pi / omega) ** 2)
        assert by.loc[method, "least_x"] == pytest.approx(0.1 - reach, abs=2e-4)
        assert by.loc[method, "outside_x"] == by.loc[method, "step_x"] == 0.0
    assert by[["least_y", "mean_y", "outside_y", "step_y"]].isna().all(axis=None)
    assert tables["stability"]["xcom_y"].notna().any()


def test_a_missing_step_is_told_by_its_length() -> None:
    """Borders at 10 mm: the longest step is how far the extrapolated CoM comes out of them, as the least margin is below zero."""
    by = stage(frames(0.01))["margins"].set_index("method")
    np.testing.assert_allclose(by["step_x"], -by["least_x"])
    assert (by["step_x"] > 0.01).all()
    assert by["outside_x"].between(0.5, 0.95).all()
