"""An effect of the user's own, from the file that the command line writes and the README shows."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import plumbline.effects
from plumbline import cli
from plumbline.effects import Channels, catalogue
from plumbline.errors import PlumblineError
from plumbline.new_effect import write

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")


def example() -> str:
    """The file in the README."""
    (found,) = [block for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "EFFECT" in block]
    return str(found)


def code_lines(text: str) -> int:
    """Lines that hold code: no comments, blanks or docstring."""
    doc = ast.parse(text).body[0].end_lineno or 0
    return sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in text.splitlines()[doc:])


def test_readme_shows_the_file_that_is_written(tmp_path: Path) -> None:
    """`plumbline new-effect rail` writes the README's example, of 15 lines of code at most."""
    list(write(tmp_path, "rail"))
    assert (tmp_path / "effects" / "rail.py").read_text(encoding="utf-8") == example()
    assert code_lines(example()) <= 15


def test_written_file_is_a_full_member(tmp_path: Path) -> None:
    """Loaded without complaint, kept to the contract; columns are finite, have one row per frame and are affine in w2."""
    list(write(tmp_path, "rail"))
    known = catalogue(tmp_path)
    assert known.broken == []
    effect = known["rail"]
    assert all((effect.title, effect.equation, effect.source, effect.needs, effect.separated))
    n = 50
    names = ("time", "com_x", "com_z", "com_dot_x", "zmp_x", "grf_x", "grf_z")
    c = Channels({k: np.linspace(0.1, 1.0, n) + i for i, k in enumerate(names)}, 100.0, 70.0, 9.0)
    assert effect.columns is not None
    assert effect.force is not None
    assert effect.columns(c).shape == effect.force(c).shape == (n, len(effect.parameters))
    assert np.isfinite(effect.columns(c)).all()
    assert (effect.force(c) < 0).all()  # against a velocity that is positive


def test_moved_into_the_library_it_is_a_member_of_every_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The unchanged file, put where the library keeps its effects, is found there."""
    list(write(tmp_path, "moved_rail"))
    monkeypatch.setattr(plumbline.effects, "HERE", tmp_path / "effects")
    monkeypatch.setattr(plumbline.effects, "__path__", [*plumbline.effects.__path__, str(tmp_path / "effects")])
    assert catalogue()["moved_rail"].title == "Something rubs"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("ang_mom", "the library has an effect 'ang_mom'"),
        ("my-rail", "small letters"),
        ("2rails", "small letters"),
        ("_rail", "small letters"),
        ("class", "small letters"),
        ("Rail", "small letters"),
        ("../rail", "small letters"),
        ("there", "is there already"),
    ],
)
def test_names_that_cannot_be(tmp_path: Path, name: str, said: str) -> None:
    """A name of the library, no identifier, or a file that is there: refused, and nothing is written."""
    list(write(tmp_path, "there"))
    before = {f: f.read_bytes() for f in tmp_path.rglob("*.py")}
    with pytest.raises(PlumblineError, match=said):
        list(write(tmp_path, name))
    assert {f: f.read_bytes() for f in tmp_path.rglob("*.py")} == before


def test_command_line_writes_lists_and_adds_it(tmp_path: Path) -> None:
    """new-effect, effects, add: three commands and the config holds the user's effect."""
    run, study = CliRunner(), ["--study", str(tmp_path)]
    assert "a member of the catalogue already" in run.invoke(cli.main, ["new-effect", "rail", *study]).output
    listed = run.invoke(cli.main, ["effects", *study]).output
    assert re.search(r"rail\* +Something rubs", listed)
    assert "* this study's own" in listed
    assert "the model 'with_rail' holds rail" in run.invoke(cli.main, ["add", "rail", *study]).output
    assert (tmp_path / "config.yaml").read_text(encoding="utf-8") == "models:\n  with_rail: [rail]\n"
