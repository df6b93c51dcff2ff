"""The open section of the study of Murai 2013: what a candidate does to the omegas, and what the ladder says of it."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from plumbline.figures import _style

STUDY = Path(__file__).resolve().parents[2] / "studies" / "murai2013"
sys.path.insert(0, str(STUDY))

from murai2013 import candidates, values  # noqa: E402
from murai2013.figures import candidates as sheet  # noqa: E402

TWIN = ("nothing", "rigid lean", "CoM shrunk")
RUNS = (4, 5, 9, 10)
KEPT = pd.read_csv(STUDY / "candidates.tsv", sep="\t").fillna({"found": "", "said": ""})


@pytest.fixture(scope="module")
def twin() -> pd.DataFrame:
    """Three candidates on half of the recordings."""
    return candidates.table(TWIN, RUNS).set_index("candidate")


def test_a_man_with_nothing_missing_has_a_smaller_omega_than_a_point_mass(twin: pd.DataFrame) -> None:
    """Legs that lean under an upright trunk lower omega by 5 %, the 2 Hz filter by more; the ladder finds nothing to add."""
    row = twin.loc["nothing"]
    assert row["point_mass"] == pytest.approx(3.11, abs=0.01)
    assert row["weak"] == pytest.approx(0.95 * row["point_mass"], rel=0.01)
    assert row["falling"] < row["near"] < 0.97 * row["weak"]
    assert row["found"] == ""
    assert row["after"] == row["base"] < 1.3 * row["floor"]


def test_a_leaning_body_lowers_omega_and_leaves_no_trace(twin: pd.DataFrame) -> None:
    """A trunk that leans with the legs takes 2 to 5 % more off omega; a fitted omega2 absorbs it, and nothing is named."""
    row = twin.loc["rigid lean"]
    assert 0.95 < row["weak"] / twin.loc["nothing", "weak"] < 0.98
    assert (row["found"], row["said"]) == ("", "absorbed")
    assert row["after"] < 1.3 * row["floor"]


def test_a_shrunk_com_lowers_omega_and_is_named(twin: pd.DataFrame) -> None:
    """A CoM scaled by -10 % lowers the near omega, is named with its size within 1 %, and the error falls to the floor."""
    row = twin.loc["CoM shrunk"]
    assert row["near"] < twin.loc["nothing", "near"] - 0.1
    assert row["said"] == "found"
    assert float(row["found"].removeprefix("com_bias: scale = ")) == pytest.approx(-0.1, abs=0.01)
    assert row["base"] > 3 * row["floor"] > 0.6 * 3 * row["after"]


def test_filtering_a_short_fall_lowers_its_omega() -> None:
    """A pendulum of 2.95 rad/s that falls for 0.8 s, without any noise, reads 2.4 to 2.65 rad/s once low-passed at 2 Hz."""
    time = np.arange(0.0, 0.8, 0.005)
    x = 0.03 * np.exp(2.95 * time)
    y = candidates.low_pass(x, time, candidates.CUTOFF).ravel()
    assert 2.4 < candidates._omega(np.gradient(np.gradient(y, time), time), y) < 2.65
    assert candidates._omega(np.gradient(np.gradient(x, time), time), x) == pytest.approx(2.95, rel=0.015)


def test_the_readme_says_the_numbers_of_the_table() -> None:
    """Every candidate of the code stands in the kept table, and every row of it in the README."""
    assert list(KEPT["candidate"]) == list(candidates.CANDIDATES)
    text = (STUDY / "README.md").read_text(encoding="utf-8")
    for row in _style.rows(KEPT):
        cells = [f"{v:.2f}" if v == v else "-" for v in (row.near, row.near_cut, row.beyond, row.falling, row.weak)]
        assert f"| {row.candidate} | {row.size} | {' | '.join(cells)} | {row.base:.2f} | {row.after:.2f} |" in text


def test_the_figure_draws_every_candidate(tmp_path: Path) -> None:
    """One row per candidate; without a table it says so."""
    paper = values.published(STUDY / "published.tsv")
    figure = sheet.draw(KEPT, paper)
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == list(KEPT["candidate"])
    _style.save(figure, tmp_path / "candidates.svg")
    assert (tmp_path / "candidates.svg").stat().st_size > 10_000
    assert sheet.draw(KEPT.iloc[:0], paper).axes[0].texts
