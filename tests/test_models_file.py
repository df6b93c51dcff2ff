"""Adding effects to the config and taking them out: what the user wrote stays, mistakes change nothing."""

from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner

from plumbline import cli
from plumbline.config import models, with_defaults
from plumbline.effects import catalogue
from plumbline.errors import PlumblineError
from plumbline.models_file import add, drop

OURS = (Path(__file__).resolve().parents[1] / "config.yaml").read_text(encoding="utf-8")
WRITTEN = [
    ("models: auto\n", "models:\n  with_sync: [sync]\n"),
    ("models:      # climb\n", "models:      # climb\n  with_sync: [sync]\n"),
    ("models: auto # why\ncsv: true", "models:      # why\n  with_sync: [sync]\ncsv: true"),
    ("", "models:\n  with_sync: [sync]\n"),
    ("# mine\n", "# mine\nmodels:\n  with_sync: [sync]\n"),
    ("csv:   true # text", "csv:   true # text\nmodels:\n  with_sync: [sync]\n"),
    ("csv: true\r\n", "csv: true\r\nmodels:\r\n  with_sync: [sync]\r\n"),
    ("{}", "{models: {with_sync: [sync]}}"),
    ("{csv: true}\n", "{csv: true, models: {with_sync: [sync]}}\n"),
    ("{models: , csv: true}", "{models: {with_sync: [sync]} , csv: true}"),
    ("{models: auto}\n", "{models: {with_sync: [sync]}}\n"),
    ("models: {up: [ang_mom]} # a\ncsv: true\n", "models: {up: [ang_mom], with_sync: [ang_mom, sync]} # a\ncsv: true\n"),
    (
        "models:\n    up: [ang_mom]  # trunk\n# end\n\ncsv:   true\n",
        "models:\n    up: [ang_mom]  # trunk\n    with_sync: [ang_mom, sync]\n# end\n\ncsv:   true\n",
    ),
    ("models:\n  up:\n  - ang_mom # trunk\n", "models:\n  up:\n  - ang_mom # trunk\n  with_sync: [ang_mom, sync]\n"),
    ("models:\n  with_sync: [sync]\n  two: [gain]", "models:\n  with_sync: [sync]\n  two: [gain]\n  with_sync_2: [gain, sync]\n"),
    ("markerset: \"auto\"\nraw: 'raw'\n", "markerset: \"auto\"\nraw: 'raw'\nmodels:\n  with_sync: [sync]\n"),
]


@pytest.mark.parametrize(("before", "after"), WRITTEN)
def test_add_changes_nothing_but_the_models(tmp_path: Path, before: str, after: str) -> None:
    """Comments, quotes, blanks, order and line ends stay byte for byte; an absent file is as an empty one."""
    file = tmp_path / "config.yaml"
    if before:
        file.write_bytes(before.encode())
    said = list(add(tmp_path, "sync"))
    assert file.read_bytes().decode() == after
    assert said[-1] == f"next: make run STUDY={tmp_path}"


@pytest.mark.parametrize(("before", "after"), [w for w in WRITTEN if "models" in w[0] and w[0].strip()])
def test_drop_is_the_reverse(tmp_path: Path, before: str, after: str) -> None:
    """What `add` has done `drop` undoes, byte for byte where the config had the key; an empty key becomes auto."""
    file = tmp_path / "config.yaml"
    file.write_bytes(after.encode())
    list(drop(tmp_path, "sync"))
    got = file.read_bytes().decode()
    named = before.replace("models: ,", "models: auto ,").replace("models:      #", "models: auto #")
    assert got.rstrip() == named.rstrip()
    assert with_defaults(yaml.safe_load(got)) == with_defaults(yaml.safe_load(before))


def test_our_own_config_survives(tmp_path: Path) -> None:
    """The repository's config with its aligned comments: two effects added and dropped again leave it as it was."""
    file = tmp_path / "config.yaml"
    file.write_text(OURS, encoding="utf-8")
    list(add(tmp_path, "ang_mom"))
    list(add(tmp_path, "sync"))
    config = with_defaults(yaml.safe_load(file.read_text(encoding="utf-8")))
    assert models(config, catalogue()) == [("with_ang_mom", ("ang_mom",)), ("with_sync", ("ang_mom", "sync"))]
    ours, new = OURS.splitlines(), file.read_text(encoding="utf-8").splitlines()
    assert [line for line in new if line not in ours and not line.startswith(("models:", "  with_"))] == []
    list(drop(tmp_path, "sync"))
    list(drop(tmp_path, "ang_mom"))
    assert file.read_text(encoding="utf-8") == OURS


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("models:\n  a: [sync]\n  b: [sync, gain]\n", "models:\n  a: [sync]\n  b: [gain]\n"),
        ("models:\n  b:\n    - sync # late\n    - gain # wide\n", "models:\n  b:\n    - gain # wide\n"),
        ("models: {b: [sync, gain]} # c\n", "models: {b: [gain]} # c\n"),
    ],
)
def test_drop_touches_the_last_model_only(tmp_path: Path, before: str, after: str) -> None:
    """An effect in the middle of the list goes, with its comment; the rungs below stay."""
    (tmp_path / "config.yaml").write_text(before, encoding="utf-8")
    list(drop(tmp_path, "sync"))
    assert (tmp_path / "config.yaml").read_text(encoding="utf-8") == after


def test_twice_says_so_and_changes_nothing(tmp_path: Path) -> None:
    """Adding what is there, and dropping what is not, leaves the file alone."""
    list(add(tmp_path, "sync"))
    file = tmp_path / "config.yaml"
    before = file.read_bytes()
    assert list(add(tmp_path, "sync")) == ["sync is in the model 'with_sync' already; nothing changed"]
    assert list(drop(tmp_path, "gain")) == ["gain is not in the model of the config; nothing changed"]
    assert file.read_bytes() == before


@pytest.mark.parametrize(
    ("config", "effect", "said"),
    [
        ("", "synk", "no effect is called 'synk': did you mean 'sync'"),
        ("", "zzzzzz", "`plumbline effects` lists them"),
        ("", "bad", r"effects/bad\.py cannot be used: line 2: NameError"),
        ("", "gain", r"effects/gain\.py cannot be used: line 1"),
        ("models: {a: [angmom]}\n", "sync", "models.a: no effect is called 'angmom': did you mean 'ang_mom'"),
        ("models: {a: [bad]}\n", "sync", "models.a: effects/bad.py cannot be used: line 2"),
        ("models: {}\n", "sync", "models"),
        ("models: autoo\n", "sync", "'models': 'auto' was expected"),
        ("models: {base: [sync]}\n", "sync", "'models': 'base' should not"),
        ("models: {a: sync}\n", "sync", "'models.a': 'sync' is not of type 'array'"),
        ("models: {a: [sync, sync]}\n", "tilt", "models.a"),
        ("model: auto\n", "sync", "did you mean 'models'"),
        ("models: {a: &x [tilt]}\nevaluation: {train: *x}\n", "sync", ""),
        ("markerset: &m auto\nmodels: *m\n", "sync", "Write this there yourself:\nmodels:\n  with_sync: .sync."),
    ],
)
def test_mistakes_are_named_and_nothing_is_written(tmp_path: Path, config: str, effect: str, said: str) -> None:
    """Unknown effects, broken effect files and broken configs are one message with the place; the file is as it was."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "bad.py").write_text("a = 1\nnonsense\n", encoding="utf-8")
    (tmp_path / "effects" / "gain.py").write_text("nonsense\n", encoding="utf-8")
    file = tmp_path / "config.yaml"
    file.write_text(config, encoding="utf-8")
    if not said:
        list(add(tmp_path, effect))
        assert yaml.safe_load(file.read_text(encoding="utf-8"))["models"] == {"a": ["tilt"], "with_sync": ["tilt", "sync"]}
        return
    with pytest.raises(PlumblineError, match=said):
        list(add(tmp_path, effect))
    assert file.read_text(encoding="utf-8") == config


def test_auto_lists_no_models() -> None:
    """Without the key, or with auto, the search climbs by itself."""
    assert models(with_defaults({}), catalogue()) == models(with_defaults({"models": None}), catalogue()) == []
    assert models(with_defaults({"models": {"paper": [], "late": ["sync"]}}), catalogue()) == [("paper", ()), ("late", ("sync",))]


def test_the_command_line_adds_drops_and_warns(tmp_path: Path) -> None:
    """What was done, what auto means now, and the next command; a twin of w2 is said to bring nothing."""
    run = CliRunner()
    done = run.invoke(cli.main, ["add", "crosstalk", "--study", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "the model 'with_crosstalk' holds crosstalk" in done.output
    assert "models was auto" in done.output
    assert "no recording of motion can tell crosstalk from w2" in done.output
    assert f"make run STUDY={tmp_path}" in done.output
    done = run.invoke(cli.main, ["drop", "crosstalk", "--study", str(tmp_path)])
    assert "crosstalk is out; models is auto" in done.output
    done = run.invoke(cli.main, ["add", "synk", "--study", str(tmp_path)])
    assert done.exit_code == 1
    assert "did you mean 'sync'" in done.output
    assert "Traceback" not in done.output
