"""An effect of the user's own, from a study that nothing explains to the file that does."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner
from made_study import EVALUATION, Result

from plumbline import cli, rungs
from plumbline.config import models, study_config
from plumbline.criticism import of_cohort, of_part, settled
from plumbline.effects import Catalogue, catalogue
from plumbline.found import Finding
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
FRICTION = {"friction": {"size": 8.0, "speed": 0.05, "height": 1.1}}  # stands in no catalogue
LAB = {"trials": 8, "duration": 8.0, "rate": 100.0, "force_rate": 500.0}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """A person who rubs against a rail in eight trials, recorded and read again."""
    study = tmp_path_factory.mktemp("rail")
    write_study(study, [draw_subject("sub-01", 3)], seed=11, effects=FRICTION, **LAB)
    return study, Result(study)


def judged(result: Result, known: Catalogue) -> Finding:
    """What the plant lacks, lateral axis, all subjects."""
    _, finding = settled(result.signals, result.pushes, result.coverage, known, EVALUATION, "lateral")
    assert finding is not None
    return finding


def test_without_the_file_something_is_left_and_nobody_is_named(made: tuple[Path, Result]) -> None:
    """Of the library's effects none is blamed for a rail that rubs, and the error stays."""
    got = judged(made[1], catalogue())
    assert list(got.found) == []
    assert got.shapes or got.left
    assert got.final > 4 * got.floor


def test_with_the_readmes_file_it_is_found_first_and_the_error_falls(made: tuple[Path, Result]) -> None:
    """The README's file in the study: named, with the largest fall and the size that was hidden; the error falls to a third or less.

    Added by the command, it stands in the study's config and its rung of the ladder has that error too.
    """
    study, result = made
    (study / "effects").mkdir(exist_ok=True)
    (text,) = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "EFFECT" in block]
    (study / "effects" / "rail.py").write_text(text, encoding="utf-8")
    known = catalogue(study)
    assert known.broken == []
    got = judged(result, known)
    first = max(got.found, key=lambda one: one.before - one.after)
    assert first.effect == "rail"
    assert next(iter(first.parameters.values()))[0] == pytest.approx(8.0, rel=0.15)
    assert first.after < first.before / 3
    assert got.final < got.base / 3
    done = CliRunner().invoke(cli.main, ["add", "rail", "--study", str(study)])
    assert done.exit_code == 0, done.output
    assert models(study_config(study), known) == [("with_rail", ("rail",))]
    table, alone, tried = of_part(result.signals, result.pushes, result.coverage, known, EVALUATION)
    about, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, known)
    climbed = [("paper", ()), *models(study_config(study), known)]
    rows, _ = rungs.of_part(
        result.signals, result.pushes, result.coverage.assign(files=""), table, about, candidates, known, climbed, EVALUATION
    )
    error = rows[rows["axis"] == "lateral"].groupby("model")["square_sum"].sum() ** 0.5
    assert error["with_rail"] < error["paper"] / 3
