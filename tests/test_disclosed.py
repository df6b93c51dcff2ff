"""The five disclosed studies: the base model's held-out error, in mm of ZMP, from the files."""

from pathlib import Path

import numpy as np
import pytest
from made_study import EVALUATION, Result

from plumbline.ladder import ladder
from plumbline.residuals import residuals

BASE = {"clean": 0.20, "ang_mom": 3.86, "height": 0.73, "sync": 2.09, "delay": 0.20}


@pytest.mark.parametrize(("name", "error"), BASE.items())
def test_base_error_is_the_published_one(shared_data: Path, name: str, error: float) -> None:
    """Within 10 % of what a plain weak-form check gave; on clean data no more than the noise floor explains, and rF stays small."""
    got = Result(shared_data / "hidden_effect" / name)
    table = ladder(got.heldout)
    pooled = table[(table["axis"] == "lateral") & (table["kind"] == "weak") & (table["task"] == "all") & (table["subject"] == "all")].iloc[
        0
    ]
    assert pooled["error_mm"] == pytest.approx(error, rel=0.10)
    if name == "clean":
        assert pooled["error_mm"] == pytest.approx(pooled["noise_floor_mm"], rel=0.10)
        frames, _ = residuals(got.signals, got.pushes, got.loci, got.coverage, got.heldout, EVALUATION)
        lateral = frames[frames["axis"] == "lateral"]
        assert np.sqrt(np.nanmean(lateral["r_force"] ** 2)) <= 0.004
