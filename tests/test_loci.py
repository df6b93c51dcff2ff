"""Pushes and loci: found where they are, not found where they are not, and named for what they are."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from plumbline import filters, tables
from plumbline.loci import of_part, split
from plumbline.physics import G
from plumbline.pushes import Event, pushes

Array = NDArray[np.float64]
RATE, MASS, HEIGHT, LIMIT = 200.0, 70.0, 1.0, 0.15
W2 = G / HEIGHT
PUSHES = ((2.0, 0.25), (6.0, 0.3), (10.0, 0.2))
XYZ = "xyz"


def frame(x: Array, p: Array, force: Array, task: str = "lateral", seed: int | None = 0) -> pd.DataFrame:
    """Table `signals` of a sideways motion: CoM x, ZMP p [m], reaction [N], all (n,); with sensor noise unless seed is None."""
    n = len(x)
    rng = np.random.default_rng(seed or 0)
    noise = 0.0 if seed is None else 1.0
    columns: dict[str, Any] = {c.name: np.full(n, np.nan) for c in tables.TABLES["signals"] if c.kind == "float"}
    columns |= {"trial": "t", "subject": "sub-01", "task": task, "condition": "", "frame": np.arange(n), "filled": False}
    columns |= {"time": 100.0 + np.arange(n) / RATE, "edge": False, "limit_left": -LIMIT, "limit_right": LIMIT}
    for k, (com, grf) in {"x": (x, force), "y": (0 * x, 0 * x), "z": (0 * x + HEIGHT, 0 * x + MASS * G)}.items():
        columns[f"com_{k}"] = columns[f"com_table_{k}"] = com + noise * 2e-4 * rng.normal(size=n)
        columns[f"grf_{k}"] = grf + noise * rng.normal(size=n)
    columns |= {"zmp_x": p, "zmp_y": 0 * p, "zmp_z": 0 * p}
    out = pd.DataFrame(columns)
    lp = filters.low_pass(out[["com_x"]].to_numpy(float), out["time"].to_numpy(float), 2.0)
    v, a = filters.derivatives(lp, out["time"].to_numpy(float))
    out["com_lp_x"], out["com_dot_x"], out["com_ddot_x"] = lp[:, 0], v[:, 0], a[:, 0]
    return out[[c.name for c in tables.TABLES["signals"]]]


def walk(
    seconds: float, blows: tuple[tuple[float, float, float], ...], x0: float = 0.0, v0: float = 0.0, rest: float = 0.0
) -> tuple[Array, Array, Array]:
    """Closed loop x'' = w2 (x - p) + F/m with p = rest + 4 (x - rest) + 1.0 x', clipped at the limits; blows: start, duration, peak [N].

    Returns x, p and the ground reaction, which does not hold the blows.  Half-sine blows; the plant acts at the CoM's height.
    """
    n, sub = int(seconds * RATE), 20
    x, v, step = x0, v0, 1.0 / RATE / sub
    xs, ps = np.empty(n), np.empty(n)
    for i in range(n):
        for k in range(sub):
            p = float(np.clip(rest + 4.0 * (x - rest) + 1.0 * v, -LIMIT, LIMIT))
            if k == 0:
                xs[i], ps[i] = x, p
            t = (i + k / sub) / RATE
            blow = sum(f * np.sin(np.pi * (t - a) / d) for a, d, f in blows if a <= t <= a + d)
            v += step * (W2 * (x - p) + blow / MASS)
            x += step * v
    return xs, ps, MASS * W2 * (xs - ps)


def pushed(sign: float = 1.0, task: str = "lateral") -> pd.DataFrame:
    """Three pushes of 80 to 130 N."""
    blows = tuple((a, d, sign * f) for (a, d), f in zip(PUSHES, (100.0, 80.0, 130.0), strict=True))
    return frame(*walk(14.0, blows), task=task)


NAMED: list[Event] = [(100.0 + a, d, "push") for a, d in PUSHES]


# -- pushes -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_pushes_are_found_where_they_are(sign: float) -> None:
    """Three half-sine pushes are found in the force balance, each edge within 50 ms, the peak within 15 %."""
    found = pushes(pushed(sign), [], MASS)
    assert list(found["source"]) == ["found"] * 3
    truth = np.array([(100.0 + a, 100.0 + a + d) for a, d in PUSHES])
    assert np.abs(found[["start", "end"]].to_numpy() - truth).max() < 0.05
    np.testing.assert_allclose(found["peak"], [100.0, 80.0, 130.0], rtol=0.15)


def test_named_pushes_are_taken_as_named() -> None:
    """Where events name pushes these are the pushes, to the digit, and their peak is measured."""
    got = pushes(pushed(), NAMED[:2], MASS)
    np.testing.assert_array_equal(got[["start", "end"]], [[102.0, 102.25], [106.0, 106.3]])
    assert list(got["source"]) == ["event", "event"]
    np.testing.assert_allclose(got["peak"], [100.0, 80.0], rtol=0.15)
    assert list(got.columns) == [c.name for c in tables.TABLES["pushes"]]


def test_quiet_standing_has_no_push() -> None:
    """Sway that obeys the force balance gives no push for any of 20 noise seeds."""
    t = np.arange(int(30 * RATE)) / RATE
    x = 0.01 * np.sin(2 * np.pi * 0.3 * t) + 0.004 * np.sin(2 * np.pi * 0.9 * t)
    a = -0.01 * (2 * np.pi * 0.3) ** 2 * np.sin(2 * np.pi * 0.3 * t) - 0.004 * (2 * np.pi * 0.9) ** 2 * np.sin(2 * np.pi * 0.9 * t)
    for seed in range(20):
        assert not len(pushes(frame(x, x - a / W2, MASS * a, seed=seed), [], MASS))


def swinging(amplitude: float, every: float) -> pd.DataFrame:
    """Quiet standing with bursts of a 10 Hz oscillation in the markers that no force shows (soft tissue)."""
    t = np.arange(int(20 * RATE)) / RATE
    phase = (t % every) / 0.3
    burst = amplitude * np.where(phase < 1, np.sin(np.pi * np.clip(phase, 0, 1)) ** 2 * np.sin(2 * np.pi * 5 * t), 0.0)
    return frame(burst, 0 * t, 0 * t)


def test_soft_tissue_is_no_push() -> None:
    """Markers that swing and come back, far above the noise, change no momentum and are no push."""
    assert not len(pushes(swinging(0.004, 5.0), [], MASS))


def test_a_seat_is_no_push() -> None:
    """A force that stays for three seconds is a contact, not a push, and is left for the residuals."""
    t = np.arange(int(20 * RATE)) / RATE
    lean = np.where((t > 8) & (t < 11), 40.0, 0.0)
    assert not len(pushes(frame(0 * t, 0 * t, -lean), [], MASS))


def test_a_misfit_in_every_second_is_no_push() -> None:
    """Twenty kicks in twenty seconds are a structural misfit and give none; two of them are two pushes."""
    t = np.arange(int(20 * RATE)) / RATE
    one = np.where((t % 1.0 > 0.4) & (t % 1.0 < 0.55), 60.0, 0.0)
    assert not len(pushes(frame(0 * t, 0 * t, one), [], MASS))
    two = np.where((t > 5) & (t < 5.9) | (t > 12) & (t < 12.9), one, 0.0)
    assert len(pushes(frame(0 * t, 0 * t, two), [], MASS)) == 2


def test_no_shear_or_no_own_com_finds_nothing() -> None:
    """Without shear, with a CoM made from the forces, or without mass no push can be found, and none is."""
    blind = pushed()
    blind[["grf_x", "grf_y"]] = np.nan
    assert not len(pushes(blind, [], MASS))
    circular = pushed()
    circular[["com_table_x", "com_lab_x"]] = np.nan
    assert not len(pushes(circular, [], MASS))
    assert not len(pushes(pushed(), [], float("nan")))
    assert len(pushes(blind, NAMED, MASS)) == 3


# -- loci -------------------------------------------------------------------------------------------------------------


def loci(signals: pd.DataFrame, events: list[Event] | None = None) -> pd.DataFrame:
    named = events or []
    return split(signals, pushes(signals, named, MASS), named)


def test_loci_run_from_push_to_push() -> None:
    """Each locus starts at a push's end and ends at the next push's onset or with the trial; frames and times agree."""
    signals = pushed()
    got = loci(signals, NAMED)
    np.testing.assert_allclose(got["start"], [102.25, 106.3, 110.2], atol=0.5 / RATE + 1e-9)
    np.testing.assert_allclose(got["end"], [106.0, 110.0, 114.0 - 1 / RATE], atol=0.5 / RATE + 1e-9)
    np.testing.assert_allclose(signals["time"].to_numpy()[got["start_frame"]], got["start"])
    np.testing.assert_allclose(signals["time"].to_numpy()[got["end_frame"]], got["end"])
    assert list(got["kind"]) == ["recovering"] * 3
    assert list(got["side"]) == ["right"] * 3
    assert np.abs(got["reference"]).max() < 2e-3
    assert list(got["locus"]) == [1, 2, 3]


def test_found_and_named_pushes_give_the_same_loci() -> None:
    """With and without the events the loci have the same kinds, sides and, within 50 ms, times."""
    signals = pushed()
    a, b = loci(signals), loci(signals, NAMED)
    assert list(a["kind"]) == list(b["kind"])
    assert list(a["side"]) == list(b["side"])
    assert np.abs(a[["start", "end"]].to_numpy() - b[["start", "end"]].to_numpy()).max() < 0.05
    assert set(a["source"]) == {"found"}
    assert set(b["source"]) == {"event"}


def test_a_mirrored_trial_gives_mirrored_loci() -> None:
    """The other side, the other sign of the reference, the same times and kinds."""
    a, b = loci(pushed(1.0), NAMED), loci(pushed(-1.0), NAMED)
    assert list(b["side"]) == ["left"] * 3
    same = ["start", "end", "start_frame", "end_frame", "kind"]
    pd.testing.assert_frame_equal(a[same], b[same])


def test_a_fall_is_a_fall() -> None:
    """A push beyond what the limits can catch is falling to its side."""
    x, p, f = walk(6.0, ((2.0, 0.25, 420.0),))
    end = int(np.argmax(np.abs(x) > 0.45))
    got = loci(frame(x[:end], p[:end], f[:end]), [(102.0, 0.25, "push")])
    assert list(got["kind"]) == ["falling"]
    assert list(got["side"]) == ["right"]


def test_a_caught_fall_ends_where_it_is_caught() -> None:
    """Where a falling CoM outside the support is pulled back inwards the locus ends before."""
    x, p, f = walk(6.0, ((2.0, 0.25, 420.0),))
    caught = int(np.argmax(x > 0.35))
    t = np.arange(len(x) - caught) / RATE
    v = (x[caught] - x[caught - 1]) * RATE
    x[caught:] = x[caught] + v * 0.15 * (1 - np.exp(-t / 0.15))  # braked
    got = loci(frame(x[: caught + 100], p[: caught + 100], f[: caught + 100]), [(102.0, 0.25, "push")])
    assert got["kind"].iloc[0] == "falling"
    assert got["end"].iloc[0] == pytest.approx(100.0 + caught / RATE, abs=0.08)


def test_a_return_from_beyond_the_support_is_told() -> None:
    """Released outside the support but moving inwards fast enough, the person recovers from beyond."""
    x, p, f = walk(8.0, (), x0=0.20, v0=-0.5)
    got = loci(frame(x, p, f), [(100.0, 0.0, "release")])
    assert list(got["kind"]) == ["recovering_from_beyond"]
    assert list(got["side"]) == ["right"]


def test_a_push_before_the_return_leaves_it_unrecovered() -> None:
    """A second push 0.35 s after the first ends a locus that had not come back."""
    x, p, f = walk(8.0, ((2.0, 0.25, 150.0), (2.6, 0.2, 30.0)))
    got = loci(frame(x, p, f), [(102.0, 0.25, "push"), (102.6, 0.2, "push")])
    assert list(got["kind"]) == ["unrecovered", "recovering"]


def test_a_trial_that_starts_away_from_rest_is_one_locus() -> None:
    """Without push or release a trial is a locus where it starts displaced, and none where it starts at rest."""
    got = loci(frame(*walk(6.0, (), x0=0.08)))
    assert list(got["kind"]) == ["recovering"]
    assert got["start"].iloc[0] == pytest.approx(100.0)
    assert got["source"].iloc[0] == "found"
    assert not len(loci(frame(*walk(6.0, (), x0=0.0))))


def test_the_reference_follows_the_target() -> None:
    """A moved target ends the locus before it and moves the reference of the loci after it."""
    first = walk(8.0, ((2.0, 0.25, 80.0),))
    second = walk(8.0, ((3.0, 0.25, 80.0),), x0=first[0][-1], rest=0.05)
    x, p, f = (np.concatenate(pair) for pair in zip(first, second, strict=True))
    signals = frame(x, p, f)
    got = loci(signals, [(102.0, 0.25, "push"), (108.0, 0.0, "target"), (111.0, 0.25, "push")])
    np.testing.assert_allclose(got["end"], [108.0, 116.0 - 1 / RATE], atol=0.5 / RATE + 1e-9)
    np.testing.assert_allclose(got["reference"], [0.0, 0.05], atol=3e-3)


def test_bad_windows_are_cut_out() -> None:
    """A bad window inside a locus leaves what is before and after it."""
    got = loci(pushed(), [*NAMED, (104.0, 0.5, "bad")])
    assert len(got) == 4
    inside = (got["start"] < 104.49) & (got["end"] > 104.01)
    assert not inside.any()


def test_named_loci_override_what_would_be_found() -> None:
    """A `locus` event is the locus, on any task; without such events other tasks have none."""
    got = loci(pushed(task="quiet"), [(103.0, 1.5, "locus")])
    assert got[["start", "end"]].to_numpy().tolist() == [[103.0, 104.5]]
    assert got["source"].iloc[0] == "event"
    assert not len(loci(pushed(task="quiet")))
    assert len(pushes(pushed(task="quiet"), [], MASS)) == 3


def test_tables_survive_writing(tmp_path: Path) -> None:
    """Loci and pushes of a part, and empty ones, have exactly their tables' columns."""
    signals = pd.concat([pushed(), pushed(task="quiet").assign(trial="u")], ignore_index=True)
    coverage = pd.DataFrame({"trial": ["t", "u"], "mass": [MASS, MASS]})
    trials = pd.DataFrame({"trial": ["t", "u"], "events": [str([list(e) for e in NAMED]).replace("'", '"'), ""]})
    found, windows = of_part(signals, coverage, trials)
    tables.write("loci", found, tmp_path / "l.parquet")
    tables.write("pushes", windows, tmp_path / "p.parquet")
    assert list(tables.read("pushes", tmp_path / "p.parquet")["source"]) == ["event"] * 3 + ["found"] * 3
    none, nothing = of_part(signals[:0], coverage, trials)
    tables.write("loci", none, tmp_path / "l.parquet")
    tables.write("pushes", nothing, tmp_path / "p.parquet")


# -- recordings -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("study", ["clean", "ang_mom", "height", "sync", "delay"])
def test_pushes_by_hand_are_found_without_their_events(shared_data: Path, study: str) -> None:
    """In each simulated study all 18 pushes are found within 50 ms from forces and markers alone, no others are, and every locus
    has the kind and side that it has with the events."""
    from plumbline.markerset import load
    from plumbline.recording import assemble
    from plumbline.signals import signals
    from plumbline.study import Participant, Trial

    raw = shared_data / "hidden_effect" / study / "raw"
    mine = load(raw / "markerset.yaml")
    truth = np.array([[1.0, 1.25], [5.0, 5.25], [9.0, 9.25]])
    for run in range(1, 7):
        file = raw / "sub-01" / f"sub-01_task-lateral_run-{run:02d}.c3d"
        recording = assemble(Trial("t", "sub-01", "", "lateral", "", str(run), (file,)))
        got = signals(recording, Participant("sub-01", 76.0, 1.78, "M"), mine, cutoff=2.0)
        mass = got.coverage["mass"]
        found = pushes(got.frames, [], mass)
        assert len(found) == 3, run
        assert np.abs(found[["start", "end"]].to_numpy() - truth).max() < 0.05, run
        events: list[Event] = [(a, b - a, "push") for a, b in truth.tolist()]
        blind, told = split(got.frames, found, []), split(got.frames, pushes(got.frames, events, mass), events)
        assert blind[["kind", "side"]].to_numpy().tolist() == told[["kind", "side"]].to_numpy().tolist(), run


@pytest.mark.parametrize("name", ["static1", "squats1", "STS1", "walking1", "walkingTS1", "DJ1"])
def test_nobody_is_pushed_who_was_not(shared_data: Path, name: str) -> None:
    """Standing, squats, sit-to-stand, gait and a jump of a person whom nobody touches hold no push."""
    from plumbline.markerset import named
    from plumbline.recording import assemble
    from plumbline.signals import signals
    from plumbline.study import Participant, Trial

    files = tuple(shared_data / "nimble_subject4" / f for f in (f"{name}.trc", f"{name}_grf.mot"))
    recording = assemble(Trial("t", "sub-01", "", "other", "", "1", files))
    got = signals(recording, Participant("sub-01", 60.0, None, ""), named("opencap"), cutoff=2.0, subject_mass=60.0)
    assert not len(pushes(got.frames, [], got.coverage["mass"]))
