"""The catalogue in words: on the command line and in docs/effects.md."""

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from plumbline import cli
from plumbline.effects import Parameter, catalogue
from plumbline.effects_text import full, listing, page, parameter

DOCS = Path(__file__).resolve().parents[1] / "docs" / "effects.md"


def test_docs_are_what_the_catalogue_says() -> None:
    """The committed page equals the one made from the files; `plumbline docs` renews it."""
    assert DOCS.read_text(encoding="utf-8") == page(catalogue()), "run `.venv/bin/plumbline docs` and commit docs/effects.md"


@pytest.mark.parametrize("name", catalogue())
def test_every_effect_has_a_source_and_what_separates_it(name: str) -> None:
    """Each has a source and, where it may look like another, the recording that tells them apart; on the plant likeness is mutual."""
    known = catalogue()
    effect = known[name]
    assert effect.source
    assert effect.separated or not (effect.confounded or effect.twin)
    assert effect.twin in ("", "w2", *known)
    alike = [known[other] for other in effect.confounded]
    assert all(name in other.confounded for other in alike if effect.ledger == other.ledger == "plant")


@pytest.mark.parametrize("name", catalogue())
def test_listing_and_page_hold_every_effect(name: str) -> None:
    """Each effect stands in the list, in full on request, and in the page with its equation and parameters."""
    known = catalogue()
    assert any(line.split()[:1] == [name] for line in listing(known, None, frozenset()))
    assert any(known[name].equation in line for line in full(known[name]))
    section = page(known).split(f"\n### {name}\n")[1].split("\n### ")[0]
    assert f"$`{known[name].equation}`$" in section
    assert all(f"- {p.name} [{p.unit}]: " in section for p in known[name].parameters)


@pytest.mark.parametrize(
    ("one", "text"),
    [
        (Parameter("c", "1/s"), "c [1/s]: any value"),
        (Parameter("c", "1/s", 0.0), "c [1/s]: from 0 on"),
        (Parameter("c", "1/s", upper=2.0), "c [1/s]: up to 2"),
        (Parameter("b", "1", -2.0, 0.0, physics=-1.0, within=0.35), "b [1]: -2 to 0; physics says -1, believed within 0.35"),
        (Parameter("t", "s", -0.2, 0.2, matters=0.003), "t [s]: -0.2 to 0.2; named from 0.003 on"),
    ],
)
def test_parameters_are_said_with_unit_and_bounds(one: Parameter, text: str) -> None:
    """Bounds that are open are said as such."""
    assert parameter(one) == text


def test_list_of_one_ledger_holds_no_other() -> None:
    """--ledger picks; an empty ledger lists nothing."""
    known = catalogue()
    mixed = {"a": replace(known["sync"], ledger="control"), "b": known["gain"]}
    lines = list(listing(mixed, "control", frozenset()))
    assert any(line.startswith("  a ") for line in lines)
    assert not any(line.startswith("  b ") for line in lines)
    assert list(listing(mixed, "robot", frozenset())) == []


def test_command_line_shows_broken_files_with_their_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The list goes on beside a broken file, which is named with its line; asked for by name it is an error. Also from within the study."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "bad.py").write_text("a = 1\nnonsense\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli.main, ["effects"])
    assert done.exit_code == 0, done.output
    assert "effects/bad.py cannot be used: line 2: NameError" in done.output
    assert "ang_mom" in done.output
    done = CliRunner().invoke(cli.main, ["effects", "bad"])
    assert done.exit_code == 1
    assert "line 2: NameError" in done.output
    assert "did you mean 'sync'" in CliRunner().invoke(cli.main, ["effects", "synk"]).output
