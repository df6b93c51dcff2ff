"""Errors are pooled as rms; the verdict never claims what was not judged."""

import numpy as np
import pandas as pd
import pytest

from plumbline import tables
from plumbline.config import with_defaults
from plumbline.ladder import Said, error_mm, ladder, verdict


def heldout(n: int = 6, subjects: int = 2) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    rows = [
        {
            "trial": f"t{i}", "subject": f"sub-{i % subjects}", "task": "lateral", "condition": "A" if i % 2 else "", "axis": axis,
            "fold": i, "w2": 9.0, "offset": 0.0, "windows": 50, "square_sum": 50 * 4e-6 * (1 + 0.1 * rng.normal()),
            "noise_variance": 1e-6, "free_run_frames": 100, "free_run_square_sum": 1e-4,
        }
        for i in range(n) for axis in ("lateral", "forward")
    ]  # fmt: skip
    return pd.DataFrame(rows)


def coverage(**change: object) -> pd.DataFrame:
    row = {c.name: {"str": "", "float": 1.0, "int": 1, "bool": False}[c.kind] for c in tables.TABLES["coverage"]}
    return pd.DataFrame([{**row, "trial": f"t{i}", "subject": f"sub-{i}", "com_method": "table", **change} for i in range(2)])


def test_errors_pool_as_rms() -> None:
    """Two trials of 1 mm and 3 mm with as many windows give sqrt(5) mm."""
    assert error_mm(np.array([1e-6, 9e-6]) * 10, np.array([10.0, 10.0]))["error_mm"] == pytest.approx(np.sqrt(5))


def test_ladder_has_the_fixed_columns() -> None:
    """The table other programs read: pooled, per task, subject and condition; weak and free-run."""
    table = ladder(heldout())
    assert list(table.columns) == [c.name for c in tables.TABLES["ladder"]]
    top = table[(table["task"] == "all") & (table["subject"] == "all") & (table["condition"] == "all") & (table["axis"] == "lateral")]
    assert set(top["kind"]) == {"weak", "free_run"}
    weak = top[top["kind"] == "weak"].iloc[0]
    assert weak["error_mm"] == pytest.approx(2.0, rel=0.1)
    assert weak["ci_low_mm"] <= weak["error_mm"] <= weak["ci_high_mm"]
    assert weak["noise_floor_mm"] == pytest.approx(1.0)
    assert set(table["condition"]) == {"all", "A"}


def test_the_verdict_says_not_judged() -> None:
    """missing is null, never an empty list; by_axis and by_subject repeat the blocks; all numbers are finite or null."""
    said = verdict(Said(ladder(heldout()), coverage(), heldout()), with_defaults({})["evaluation"])
    assert said["plant"]["missing"] is None
    assert said["plant"]["unexplained"] is None
    assert said["plant"]["final_error_mm"] is None
    assert said["plant"]["base_error_mm"] == pytest.approx(2.0, rel=0.1)
    assert said["plant"] == said["by_axis"]["lateral"]["plant"]
    assert set(said["by_subject"]) == {"sub-0", "sub-1"}
    assert said["control"]["base_error_mm"] is None
    assert said["control"]["reason"]


def test_an_unknown_floor_is_null_and_says_why() -> None:
    """Where a file was filtered before, the floor is not zero but unknown."""
    table = heldout().assign(noise_variance=float("nan"))
    said = verdict(Said(ladder(table), coverage(filtered_before=True), table), with_defaults({})["evaluation"])
    assert said["plant"]["noise_floor_mm"] is None
    assert "low-passed before" in said["plant"]["reason"]


def test_a_study_without_any_trial_has_a_verdict() -> None:
    """Everything excluded: nulls with a reason, not a crash."""
    said = verdict(
        Said(ladder(tables.empty("heldout")), tables.empty("coverage"), tables.empty("heldout")), with_defaults({})["evaluation"]
    )
    assert said["plant"]["base_error_mm"] is None
    assert "exclusions" in said["plant"]["reason"]


def test_reasons_speak_of_the_judged_trials_only() -> None:
    """A force-only trial that no error stands behind is not blamed for an unknown floor, and is counted as not judged."""
    table = heldout().assign(noise_variance=float("nan"))
    table = table[table["trial"] == "t0"]
    known = coverage(filtered_before=True)
    known.loc[1, "com_method"] = "force"
    reason = verdict(Said(ladder(table), known, table), with_defaults({})["evaluation"])["plant"]["reason"]
    assert "1 of the 2 trials with a CoM were judged" in reason
    assert "low-passed before" in reason
    assert "integrated from the force" not in reason


def test_a_model_without_a_rung_is_told() -> None:
    """A model that some subjects could not be judged with is named beside the verdict, with who; one of the law alone is not."""
    table = heldout()
    rungs = table[table["subject"] == "sub-0"].assign(rung=1, model="own", effects="sesc").drop(columns="noise_variance")
    models = [("own", ("sesc",)), ("law", ("lag",))]
    said = verdict(Said(ladder(table, rungs), coverage(), table), with_defaults({})["evaluation"], models=models)
    for axis in ("lateral", "forward"):
        reason = said["by_axis"][axis]["plant"]["reason"]
        assert "model 'own' has no rung for sub-1:" in reason
        assert "law" not in reason
    assert said["plant"] == said["by_axis"]["lateral"]["plant"]
