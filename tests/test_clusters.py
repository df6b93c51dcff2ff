"""Tables `clusters`, `choice` and `controller` from signals in memory."""

import numpy as np
import pandas as pd
import pytest
from made_loci import PUBLISHED, made, tabled

from plumbline import clusters, tables, trust

WEAK = {"half_width": 0.4, "exponent": 4}
Tables = tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]


def run(study: tuple[pd.DataFrame, ...]) -> Tables:
    signals, pushes, loci, coverage, trials = study
    parts, _ = trust.of_part(signals, pushes, loci, coverage, trials, WEAK)
    return clusters.of_part(signals, pushes, loci, coverage, parts, WEAK)


@pytest.fixture(scope="module")
def two() -> Tables:
    """Condition `free`: 16 loci each of two omegas and some falls; condition `held`: 16 loci of one omega."""
    far = made("A", 31, n=16, starts=("saturated",), omega=2.117, k2=0.875 * 2.740 / 2.117)
    near = made("A", 32, n=16, starts=("saturated",))
    signals, pushes, loci, coverage, trials = tabled(
        {"free": far + near, "held": made("B", 33, n=16, starts=("saturated",)), "fall": made("B", 34, n=2, starts=("falling",))},
        omega=2.7,
        kinds={"fall": "falling"},
    )
    rename = {"fall": "held"}
    frames = [t.assign(condition=t["condition"].replace(rename)) if "condition" in t else t for t in (signals, pushes, loci, coverage)]
    return run((*frames, trials))


def test_two_omegas_are_two_clusters_and_one_is_one(two: Tables) -> None:
    """The far and near loci of one condition part; every locus is in the right one; the other condition stays whole."""
    members, choice, controller = two
    free = members[members["condition"] == "free"].sort_values("trial")
    assert free["cluster"].tolist() == [1] * 16 + [2] * 16
    chosen = choice[choice["chosen"]].set_index("condition")["number"]
    assert chosen.to_dict() == {"free": 2, "held": 1}
    rows = controller[(controller["condition"] == "free") & (controller["method"] == "output error")].set_index("cluster")
    assert rows.loc[1, "omega"] == pytest.approx(2.117, rel=0.005)
    assert rows.loc[2, "omega"] == pytest.approx(2.740, rel=0.005)
    assert set(controller.loc[controller["condition"] == "held", "cluster"]) == {0}


def test_gains_and_limits_of_a_cluster(two: Tables) -> None:
    """The near cluster has the published gains within 3 % and its intervals hold them; limits within 1 mm; poles complex."""
    rows = two[2]
    row = rows[(rows["condition"] == "free") & (rows["cluster"] == 2) & (rows["method"] == "output error")].iloc[0]
    for name in ("k1", "k2", "omega"):
        assert row[name] == pytest.approx(PUBLISHED["A"][name], rel=0.03)
        assert row[f"{name}_low"] < row[name] < row[f"{name}_high"]
    assert (row["limit_left"], row["limit_right"]) == pytest.approx((-0.1, 0.1), abs=1e-3)
    assert row["q1_imag"] == -row["q2_imag"] != 0
    assert row["loci"] == 16


def test_falls_show_limits_and_not_gains(two: Tables) -> None:
    """A falling locus is not used for the gains, and the table says so."""
    members = two[0]
    falls = members[members["kind"] == "falling"]
    assert len(falls) == 2
    assert not falls["gains"].any()
    assert falls["note"].str.contains("falls").all()
    rest = members[members["kind"] != "falling"]
    assert (rest["gains"] == (rest["note"] == "")).all()
    assert rest["gains"].mean() > 0.9


def test_every_method_stands_beside_the_others(two: Tables) -> None:
    """Four rows per cluster; least squares is called the counter-example it is."""
    held = two[2][two[2]["condition"] == "held"].set_index("method")
    assert set(held.index) == {"output error", "output error with delay", "instruments", "saturation"}
    assert "comparison" in held.loc["saturation", "warning"]
    assert held.loc["output error with delay", "delay_low"] == 0.0
    assert np.isnan(held.loc["output error", "delay"])


def test_tables_have_their_columns(two: Tables) -> None:
    """All three are what `tables` says."""
    for name, table in zip(("clusters", "choice", "controller"), two, strict=True):
        assert set(table.columns) == {c.name for c in tables.TABLES[name]}


def test_a_persons_mark_reaches_the_limits() -> None:
    """Regimes moved by 0.3 s into the law's frames move the limit: the table `trust` is what the limits come from."""
    study = tabled({"": made("A", 41, n=8, starts=("saturated",))}, omega=2.740)
    signals, pushes, loci, coverage, trials = study
    parts, _ = trust.of_part(signals, pushes, loci, coverage, trials, WEAK)
    late = parts.copy()
    late.loc[late["part"] == 2, "start"] += 0.3
    late.loc[late["part"] == 1, "end"] += 0.3
    limits = [
        clusters.of_part(signals, pushes, loci, coverage, p, WEAK)[2].iloc[0][["limit_left", "limit_right"]].to_numpy(float)
        for p in (parts, late)
    ]
    assert np.nanmax(np.abs(limits[1] - limits[0])) > 5e-3


def test_too_few_loci_say_so() -> None:
    """Two loci give an omega, no gains, and the reason."""
    rows = run(tabled({"": made("A", 42, n=2, starts=("saturated",))}, omega=2.740))[2]
    assert len(rows) == 1
    assert np.isfinite(rows.iloc[0]["omega"])
    assert np.isnan(rows.iloc[0]["k1"])
    assert "3 are needed" in rows.iloc[0]["warning"]


def test_a_study_without_loci_has_empty_tables() -> None:
    """No locus: three empty tables with their columns."""
    signals, pushes, loci, coverage, _ = tabled({"": made("A", 42, n=1)}, omega=2.740)
    got = clusters.of_part(signals, pushes, loci.iloc[:0], coverage, tables.empty("trust"), WEAK)
    assert [len(t) for t in got] == [0, 0, 0]
    assert set(got[2].columns) == {c.name for c in tables.TABLES["controller"]}


def test_a_gap_is_said() -> None:
    """A locus with a gap is used up to it and says so; one that is all gap is left out and says so."""
    signals, pushes, loci, coverage, trials = tabled({"": made("A", 43, n=6, starts=("saturated",))}, omega=2.740)
    first, second = sorted(loci["trial"])[:2]
    signals.loc[(signals["trial"] == first) & signals["time"].between(2.0, 2.1), "com_x"] = np.nan
    signals.loc[signals["trial"] == second, "zmp_x"] = np.nan
    members = run((signals, pushes, loci, coverage, trials))[0].set_index("trial")
    assert members.loc[first, "gains"]
    assert "only 0.00 to 2.00 s" in members.loc[first, "note"]
    assert not members.loc[second, "gains"]
    assert "no weak plant" in members.loc[second, "note"] or "no unbroken" in members.loc[second, "note"]
