"""Tables `trust` and `rls`: regimes with their switches, a person's marks, the returning-RLS rule."""

import json

import numpy as np
import pandas as pd
import pytest
from made_loci import PUBLISHED, batched, made, tabled, true_switches

from plumbline import law as laws
from plumbline import tables, trust

WEAK = {"half_width": 0.4, "exponent": 4}
LIMITS = (-0.1, 0.1)


@pytest.fixture(scope="module")
def study() -> tuple[pd.DataFrame, ...]:
    """Twelve recordings of condition A, one locus each."""
    return tabled({"free": made("A", 21, n=12, starts=("saturated",), duration=3.0)}, omega=2.740)


@pytest.fixture(scope="module")
def found(study: tuple[pd.DataFrame, ...]) -> tuple[pd.DataFrame, pd.DataFrame]:
    return trust.of_part(*study, WEAK)


def test_parts_tile_the_locus(study: tuple[pd.DataFrame, ...], found: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    """Every frame of a locus lies in exactly one part, parts alternate, times and frames agree."""
    for (trial, _), parts in found[0].groupby(["trial", "locus"]):
        locus = study[2].set_index("trial").loc[trial]
        covered = np.concatenate([np.arange(a, b + 1) for a, b in zip(parts["start_frame"], parts["end_frame"], strict=True)])
        np.testing.assert_array_equal(covered, np.arange(locus["start_frame"], locus["end_frame"] + 1))
        assert (parts["regime"].to_numpy()[1:] != parts["regime"].to_numpy()[:-1]).all()
        np.testing.assert_allclose(parts["start"].to_numpy()[1:], parts["end"].to_numpy()[:-1])
        assert parts["source"].tolist() == ["start"] + ["found"] * (len(parts) - 1)


def test_switches_lie_where_the_truth_has_them(found: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    """The last switch of each locus within 25 ms of the truth, in the file's own time."""
    loci = made("A", 21, n=12, starts=("saturated",), duration=3.0)
    last = found[0][found[0]["part"] > 1].groupby("trial")["start"].last().to_numpy()
    true = [true_switches(one, LIMITS)[-1] for one in loci]
    np.testing.assert_allclose(last, true, atol=0.025)


def test_a_mark_overrides_and_its_distance_is_shown(study: tuple[pd.DataFrame, ...], found: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    """A `switch` event moves the nearest switch to itself; what was found stays in the table beside it."""
    signals, pushes, loci, coverage, trials = study
    switch = found[0][found[0]["part"] == 2].iloc[0]
    mark = float(switch["found"]) + 0.04
    marked = trials.copy()
    marked.loc[marked["trial"] == switch["trial"], "events"] = json.dumps([[mark, 0.0, "switch"]])
    again = trust.of_part(signals, pushes, loci, coverage, marked, WEAK)[0]
    row = again[(again["trial"] == switch["trial"]) & (again["part"] == 2)].iloc[0]
    assert row["source"] == "event"
    assert row["start"] == pytest.approx(mark)
    assert row["found"] == pytest.approx(switch["found"])
    assert row["mark_distance"] == pytest.approx(-0.04)
    before = again[(again["trial"] == switch["trial"]) & (again["part"] == 1)].iloc[0]
    assert before["end"] == pytest.approx(mark)
    assert before["end_frame"] + 1 == row["start_frame"] == int(np.ceil(mark * 200 - 1e-6))
    others = again[again["trial"] != switch["trial"]].reset_index(drop=True)
    pd.testing.assert_frame_equal(others, found[0][found[0]["trial"] != switch["trial"]].reset_index(drop=True))


def test_the_pass_back_ends_where_the_pass_forward_ended(found: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    """Over a whole locus both passes hold the same sums: theta_B[1] = theta_F[N] (Murai 2013), for omega, k1 and k2."""
    for _, trace in found[1].groupby(["trial", "locus"]):
        for name in ("omega", "k1", "k2"):
            assert trace[f"{name}_backward"].iloc[0] == pytest.approx(trace[f"{name}_forward"].iloc[-1], rel=1e-6)


def test_tables_have_their_columns(found: tuple[pd.DataFrame, pd.DataFrame]) -> None:
    """Both tables are what `tables` says, and the trace has one row per frame."""
    for name, table in zip(("trust", "rls"), found, strict=True):
        assert set(table.columns) == {c.name for c in tables.TABLES[name]}
    assert found[1].groupby("trial")["frame"].apply(lambda f: (np.diff(f) == 1).all()).all()


@pytest.mark.parametrize(("name", "most_missed"), [("A", 0.15), ("B", 0.5)])
def test_the_rule_of_returning_rls(name: str, most_missed: float) -> None:
    """Where the rule sees a switch, its median error is at most 40 ms and nine of ten lie within 120 ms; falling loci, reversed, too.

    It is blind where the law never asks for 10 mm more than the limit gives: half of the loci of the weaker controller B.
    """
    omega = PUBLISHED[name]["omega"]
    loci = [one for one in made(name, 5, n=24, starts=("saturated", "leaving")) if len(one.x) > 60]
    falling = np.array([len(one.x) < 801 for one in loci])
    b = batched(loci, omega)
    found = laws.regimes(b, omega, ~falling)
    assert found is not None
    switch = trust.Passes.of(b, found.saturation.law, found.noise, falling).switch
    true = [true_switches(one, LIMITS) for one in loci]
    known = [(s, t[0] if f else t[-1], f) for s, t, f in zip(switch, true, falling, strict=True) if len(t)]
    seen = [(s - t, f) for s, t, f in known if np.isfinite(s)]
    assert sum(f for _, f in seen) >= 10
    for order in (True, False):
        errors = np.abs([e for e, f in seen if f == order])
        assert np.median(errors) <= 0.040
        assert np.percentile(errors, 90) <= 0.120
    assert len(known) - len(seen) <= most_missed * len(known)


def test_a_study_without_loci_has_empty_tables(study: tuple[pd.DataFrame, ...]) -> None:
    """No locus: no part, no trace, no error."""
    signals, pushes, _, coverage, trials = study
    parts, traces = trust.of_part(signals, pushes, tables.empty("loci"), coverage, trials, WEAK)
    assert len(parts) == len(traces) == 0
    assert set(parts.columns) == {c.name for c in tables.TABLES["trust"]}


def test_marks_keep_the_order_of_time() -> None:
    """Marks never cross, each switch takes at most one, and surplus marks are the farthest ones."""
    found = np.array([1.0, 2.0])
    np.testing.assert_array_equal(trust._marks(found, [2.2, 2.05]), [2.05, 2.2])
    np.testing.assert_array_equal(trust._marks(found, [1.9]), [np.nan, 1.9])
    np.testing.assert_array_equal(trust._marks(found[:1], [3.0, 1.2]), [1.2])
    assert len(trust._marks(found[:0], [1.0])) == 0


def test_a_mark_without_a_switch_is_said(study: tuple[pd.DataFrame, ...]) -> None:
    """More marks than switches: the log names the trial and the instants that were not used."""
    signals, pushes, loci, coverage, trials = study
    marked = trials.copy()
    marked.loc[0, "events"] = json.dumps([[0.1 * k + 0.2, 0.0, "switch"] for k in range(20)])
    with pytest.warns(UserWarning, match=r"run-000, locus 1: no switch was found for the mark at"):
        trust.of_part(signals, pushes, loci, coverage, marked, WEAK)
