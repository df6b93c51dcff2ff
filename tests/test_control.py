"""The control ledger against simulated laws: what it names, and that it names nothing where nothing is hidden."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from made_loci import PUBLISHED, made, tabled
from made_study import EVALUATION, Result

from plumbline import clusters, control, trust
from plumbline.control_verdict import judge

WEAK = {"half_width": EVALUATION["half_width"], "exponent": EVALUATION["exponent"]}
Tables = dict[str, pd.DataFrame]


def stages(signals: pd.DataFrame, pushes: pd.DataFrame, loci: pd.DataFrame, coverage: pd.DataFrame, trials: pd.DataFrame) -> Tables:
    """The tables that the ledger reads."""
    regimes, _ = trust.of_part(signals, pushes, loci, coverage, trials, WEAK)
    members, _, controller = clusters.of_part(signals, pushes, loci, coverage, regimes, WEAK)
    names = ("signals", "pushes", "loci", "coverage", "trust", "clusters", "controller")
    return dict(zip(names, (signals, pushes, loci, coverage, regimes, members, controller), strict=True))


def pendulum(seed: int, **options: Any) -> Tables:
    """Sixteen trials of one locus each, set B."""
    loci = made("B", seed, n=8, **options)
    made_tables = tabled({"": loci}, omega=PUBLISHED["B"]["omega"])
    signals = made_tables[0].assign(ang_mom_y=0.0)
    return stages(signals, *made_tables[1:])


def study(folder: Path) -> Tables:
    """The tables of a study on disk."""
    got = Result(folder)
    trials = pd.DataFrame({"trial": got.signals["trial"].unique(), "events": "[]"})
    return stages(got.signals, got.pushes, got.loci, got.coverage, trials)


def ledger(tables: Tables, **options: Any) -> pd.DataFrame:
    """Table `control`."""
    return control.of_part(**tables, evaluation=WEAK, **options)


@pytest.mark.parametrize("seed", [11, 12])
def test_a_clean_law_is_not_accused(seed: int) -> None:
    """Nothing missing; the errors of base, model and end are one number, the floor at most 5 % below it."""
    block = judge(ledger(pendulum(seed)))
    assert block["missing"] == []
    assert not block["unexplained"]
    assert block["base_error_mm"] == block["model_error_mm"] == block["final_error_mm"]
    assert 0.9 < block["noise_floor_mm"] / block["base_error_mm"] <= 1.0


def test_a_delay_of_a_published_law() -> None:
    """100 ms in set B: named with its family, within 10 ms and its error of CoM no larger than before."""
    block = judge(ledger(pendulum(5, delay=0.1)), model=["delay"])
    assert [m["effect"] for m in block["missing"]] == ["delay"]
    found = block["missing"][0]
    assert found["in_model"]
    assert found["parameters"]["delay"]["value"] == pytest.approx(0.1, abs=0.01)
    assert found["error_after_mm"] == block["final_error_mm"] == block["model_error_mm"] < found["error_before_mm"]
    assert found["q_value"] < 0.01


def test_the_disclosed_delay(shared_data: Path) -> None:
    """80 ms within 10 ms on the study that hides it."""
    block = judge(ledger(study(shared_data / "hidden_effect" / "delay")))
    assert [m["effect"] for m in block["missing"]] == ["delay"]
    assert block["missing"][0]["parameters"]["delay"]["value"] == pytest.approx(0.08, abs=0.01)


@pytest.mark.parametrize("name", ["clean", "sync", "ang_mom", "height"])
def test_the_disclosed_studies_with_nothing_in_the_law(shared_data: Path, name: str) -> None:
    """No accusation; with the late force record put back the gains are within 2 % of the truth, 4.0 and 0.9 s."""
    corrected = {"sub-01": {"sync.delay": 0.016}} if name == "sync" else None
    table = ledger(study(shared_data / "hidden_effect" / name), corrected=corrected)
    assert judge(table)["missing"] == []
    base = table[(table["mode"] == "loop") & (table["candidate"] == "")].iloc[0]
    assert (base["k1"], base["k2"]) == pytest.approx((4.0, 0.9), rel=0.02)


def test_too_few_loci_are_not_judged() -> None:
    """Three loci: no verdict, the errors null, the reason says how many are needed."""
    tables = pendulum(11)
    few = copy.copy(tables) | {"loci": tables["loci"].head(3)}
    block = judge(ledger(few))
    assert block["missing"] is None
    assert block["base_error_mm"] is None
    assert "4 of 2 are needed" in block["reason"]


def test_without_the_task_there_is_no_verdict() -> None:
    """A study of another task has no rows and says what the ledger needs."""
    tables = pendulum(11)
    table = ledger(tables | {"loci": tables["loci"].assign(task="quiet")})
    assert table.empty
    assert "lateral" in judge(table)["reason"]


def test_a_constant_offset_of_the_plates_changes_no_law() -> None:
    """20 mm on the ZMP: the gains within 0.5 %, nothing named."""
    tables = pendulum(12)
    moved = tables | {"signals": tables["signals"].assign(zmp_x=tables["signals"]["zmp_x"] + 0.02)}
    tables_of = [ledger(stages(one["signals"], one["pushes"], one["loci"], one["coverage"], _trials(one))) for one in (tables, moved)]
    gains = [t[(t["mode"] == "loop") & (t["candidate"] == "")].iloc[0][["k1", "k2"]].to_numpy(float) for t in tables_of]
    np.testing.assert_allclose(gains[1], gains[0], rtol=5e-3)
    assert judge(tables_of[1])["missing"] == []


def _trials(tables: Tables) -> pd.DataFrame:
    return pd.DataFrame({"trial": tables["signals"]["trial"].unique(), "events": "[]"})
