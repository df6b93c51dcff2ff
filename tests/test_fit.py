"""The base model on loci whose truth is known, and on the disclosed studies."""

import numpy as np
import pandas as pd
import pytest

from plumbline.config import with_defaults
from plumbline.fit import Windows, folds, identify, solve, windows
from plumbline.ladder import ladder
from plumbline.plant import Plant, pieces
from plumbline.simulate.pendulum import loci
from plumbline.weak import Bump, white_noise_sd

EVALUATION = with_defaults({})["evaluation"]


def study(found: list, subject: str = "sub-01") -> tuple[pd.DataFrame, ...]:
    """Tables of loci from the pendulum: each locus is a trial of its own; the forward axis stands still."""
    signals, rows, about = [], [], []
    for k, locus in enumerate(found):
        n, trial = len(locus.x), f"{subject}_task-lateral_run-{k + 1:04d}"
        key = {"trial": trial, "subject": subject, "task": "lateral", "condition": ""}
        zero = np.zeros(n)
        signals.append(
            pd.DataFrame(
                {
                    **key, "frame": np.arange(n), "time": locus.time, "com_x": locus.x, "com_y": zero, "com_z": zero + 1, "zmp_x": locus.p,
                 "zmp_y": zero, "zmp_z": zero, "grf_x": zero, "grf_y": zero, "grf_z": zero + 700}
            )
        )  # fmt: skip
        rows.append({**key, "locus": 1, "start_frame": 0, "end_frame": n - 1})
        about.append({**key, "com_method": "table", "filtered_before": False, "mass": 70.0})
    pushes = pd.DataFrame({"trial": [], "start": [], "end": []})
    return pd.concat(signals, ignore_index=True), pushes, pd.DataFrame(rows), pd.DataFrame(about)


def omega_of(found: list) -> pd.Series:
    fits, _ = identify(*study(found), EVALUATION)
    return fits[(fits["level"] == "subject") & (fits["axis"] == "lateral")].iloc[0]


SETS = [(2.740, 4.038, 0.875), (2.808, 2.204, 0.549)]


@pytest.mark.parametrize(("omega", "k1", "k2"), SETS)
@pytest.mark.parametrize("start", ["saturated", "unsaturated", "falling"])
def test_omega_is_unbiased_and_its_interval_honest(omega: float, k1: float, k2: float, start: str) -> None:
    """32 loci, 1 mm of noise on both sensors, 400 repetitions: bias <= 0.2 %, sd <= 0.3 %, 95 % interval covers 0.90-0.98."""
    repetitions, rows = 400, []
    for block in range(8):
        pool = quick(loci(32 * repetitions // 8, omega=omega, k1=k1, k2=k2, start=start, seed=20 + block))
        rows += [estimate(pool[32 * r : 32 * (r + 1)]) for r in range(repetitions // 8)]
    got = pd.DataFrame(rows, columns=["omega", "low", "high"])
    assert len(got) == repetitions
    assert abs(got["omega"].mean() / omega - 1) <= 2e-3
    assert (got["omega"] / omega).std() <= 3e-3
    assert 0.90 <= ((got["low"] <= omega) & (omega <= got["high"])).mean() <= 0.98


def quick(found: list) -> list[Windows]:
    """The windows of loci without the tables, all bumps at once."""
    bump, nan, longest = Bump(0.4, 4, 200.0), float("nan"), max(len(one.x) for one in found)
    x, p = (np.column_stack([np.pad(v, (0, longest - len(v)), constant_values=nan) for v in one]) for one in
            ([one.x for one in found], [one.p for one in found]))  # fmt: skip
    mean_x, mean_p, second = bump.mean(x), bump.mean(p), bump.second(x)
    noise_x, noise_p, none = white_noise_sd(x), white_noise_sd(p), np.full(longest, nan)
    out = []
    for k in range(len(found)):
        piece = pieces(np.isfinite(x[:, k]), 2000)
        got = (mean_x[:, k], mean_p[:, k], none, second[:, k], none, none, 1.0, piece, x[:, k], p[:, k])
        plant = Plant(200.0, *got, float(noise_x[k]), float(noise_p[k]), bump)
        out.append(Windows("", "", "", "", "lateral", plant, np.arange(longest) / 200, np.ones(longest, int)))
    return out


def estimate(chosen: list[Windows]) -> tuple[float, float, float]:
    """omega and its interval [rad/s]."""
    fit = solve([(w, w.picked) for w in chosen])
    assert fit is not None
    return fit.omega, *fit.omega_interval()


def test_the_tables_give_what_the_shortcut_gives() -> None:
    """The repetitions above skip the tables; here both ways are the same number."""
    found = loci(8, omega=2.74, k1=4.038, k2=0.875, seed=3)
    row, direct = omega_of(found), estimate(quick(found))
    np.testing.assert_allclose(row[["omega", "omega_low", "omega_high"]].to_numpy(float), direct, rtol=1e-9)


def test_noise_free_loci_give_omega_exactly() -> None:
    """Without noise the weak form has only its own discretisation: 5e-5, recovering and falling."""
    for start in ("saturated", "falling"):
        found = loci(8, omega=2.74, k1=4.038, k2=0.875, start=start, marker_noise=0, cop_noise=0, seed=1)
        found = [one for one in found if len(one.x) > 170]
        assert omega_of(found)["omega"] == pytest.approx(2.74, rel=5e-5)


def test_a_cop_offset_moves_the_offset_and_not_omega() -> None:
    """A plate that reads 10 mm off leaves omega alone; the base rung's error, without a constant, shows the 10 mm."""
    signals, *others = study(loci(8, omega=2.74, k1=4.038, k2=0.875, marker_noise=0, cop_noise=0, seed=1))
    fits, heldout = identify(signals.assign(zmp_x=signals["zmp_x"] + 0.01), *others, EVALUATION)
    row = fits[(fits["level"] == "subject") & (fits["axis"] == "lateral")].iloc[0]
    assert row["omega"] == pytest.approx(2.74, rel=5e-5)
    assert row["offset"] == pytest.approx(0.01, rel=1e-3)
    table = ladder(heldout)
    assert table.loc[(table["kind"] == "weak") & (table["subject"] == "all"), "error_mm"].iloc[0] == pytest.approx(10.0, rel=1e-3)


def test_mirrored_data_give_mirrored_results() -> None:
    """x -> -x: the same omega, the same errors, the opposite offset, to rounding."""
    signals, *others = study(loci(6, omega=2.74, k1=4.038, k2=0.875, seed=4))
    mirrored = signals.assign(com_x=-signals["com_x"], zmp_x=-signals["zmp_x"])
    (a, ea), (b, eb) = identify(signals, *others, EVALUATION), identify(mirrored, *others, EVALUATION)
    np.testing.assert_allclose(a["omega"], b["omega"], rtol=1e-10)
    np.testing.assert_allclose(a["offset"], -b["offset"], atol=1e-12)
    np.testing.assert_allclose(ea["square_sum"], eb["square_sum"], rtol=1e-9)


def test_trials_are_left_out_whole() -> None:
    """Eight folds of whole trials, one by one when fewer; every trial is judged once, never by itself."""
    tables = study(loci(11, omega=2.74, k1=4.038, k2=0.875, seed=5))
    mine = [w for w in windows(tables[0], tables[1], tables[2], tables[3], EVALUATION) if w.axis == "lateral"]
    got = list(folds(mine, EVALUATION))
    assert len(got) == 8
    assert sorted(w.trial for _, _, test in got for w in test) == sorted(w.trial for w in mine)
    assert all(not {w.trial for w in train} & {w.trial for w in test} for _, train, test in got)
    assert len(list(folds(mine[:3], EVALUATION))) == 3
    assert list(folds(mine[:1], EVALUATION)) == []


def test_an_explicit_comparison_trains_and_tests_where_it_is_told() -> None:
    """Tasks, trial ids, or a task with its run; a trial named on both sides is tested only."""
    tables = study(loci(4, omega=2.74, k1=4.038, k2=0.875, seed=6))
    mine = [w for w in windows(*tables, EVALUATION) if w.axis == "lateral"]
    assert {"lateral", "lateral_run-0001", mine[0].trial} <= mine[0].names
    assert not mine[0].names & {"lateral_run-0002", "quiet"}
    asked = {**EVALUATION, "train": ["lateral"], "test": [mine[2].trial]}
    ((number, train, test),) = folds(mine, asked)
    assert (number, len(train), [w.trial for w in test]) == (0, 3, [mine[2].trial])


@pytest.mark.parametrize(("w2", "offset"), [("height", "none"), ("fit", "train")])
def test_choices_of_the_comparison(w2: str, offset: str) -> None:
    """w2 = g/z where the config says height; a trained constant takes an offset off the error."""
    signals, *others = study(loci(4, omega=2.74, k1=4.038, k2=0.875, marker_noise=0, cop_noise=0, seed=7))
    _, heldout = identify(signals.assign(zmp_x=signals["zmp_x"] + 0.01), *others, {**EVALUATION, "w2": w2, "offset": offset})
    mine = heldout[heldout["axis"] == "lateral"]
    if w2 == "height":
        assert mine["w2"].unique() == pytest.approx([9.81])
    else:
        assert np.sqrt(mine["square_sum"].sum() / mine["windows"].sum()) < 1e-4


def test_a_trial_too_slow_for_the_test_function_is_named() -> None:
    """At 8 Hz no bump of 0.4 s fits: the trial has a row that says so, and the others are fitted as before."""
    signals, pushes, rows, coverage = study(loci(4, omega=2.74, k1=4.038, k2=0.875, seed=8))
    slow = coverage["trial"].iloc[0]
    thin = signals[(signals["trial"] != slow) | (signals["frame"] % 25 == 0)]
    fits, heldout = identify(thin, pushes, rows.iloc[1:], coverage, EVALUATION)
    said = fits[fits["level"] == "trial"]
    assert set(said["trial"]) == {slow}
    assert said["warning"].str.contains("8 Hz is too slow").all()
    assert slow not in set(heldout["trial"])
    assert len(heldout[heldout["axis"] == "lateral"]) == 3
