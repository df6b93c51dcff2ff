"""The command line as a user types it."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from plumbline import cli
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One trial that can be read, one broken file, one with a foreign name."""
    folder = tmp_path_factory.mktemp("own data ü")
    write_study(folder, [draw_subject("sub-01", seed=1)], trials=1, duration=3.0, seed=1)
    (folder / "raw" / "sub-01" / "sub-01_task-lateral_run-07.c3d").write_bytes(b"")
    (folder / "raw" / "Walk 3.c3d").write_bytes(b"x")
    return folder


def test_check_says_what_is_usable_and_why_the_rest_is_not(small: Path) -> None:
    """Rates, plates, axes, marker set; a reason and advice for each file that fails; nothing is written."""
    before = sorted(small.rglob("*"))
    done = CliRunner().invoke(cli.main, ["check", str(small)])
    assert done.exit_code == 0, done.output
    assert "yes  sub-01_task-lateral_run-01: 3.0 s at 200 Hz, 25 markers, 2 plates" in done.output
    assert "100 % of body mass" in done.output
    assert "no   sub-01_task-lateral_run-07: empty_file" in done.output
    assert "no   Walk 3.c3d: not_named" in done.output
    assert "1 of 2 trials can be read, 1 files belong to none" in done.output
    assert sorted(small.rglob("*")) == before


def test_check_fails_where_nothing_is_usable(tmp_path: Path) -> None:
    """A script can ask: exit code 1."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "sub-1_task-a.c3d").write_bytes(b"")
    assert CliRunner().invoke(cli.main, ["check", str(tmp_path)]).exit_code == 1


@pytest.mark.parametrize(
    ("config", "said"), [("signal: {}", "did you mean 'signals'"), ("a: [b", "no valid YAML"), ("markerset: plug-in-gat", "plug-in-gait")]
)
def test_a_broken_config_is_one_line(tmp_path: Path, config: str, said: str) -> None:
    """No traceback."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "config.yaml").write_text(config)
    done = CliRunner().invoke(cli.main, ["check", str(tmp_path)])
    assert done.exit_code == 1
    assert said in done.output
    assert "Traceback" not in done.output


def test_data_links_known_sets_and_names_the_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """studies/NAME/raw becomes a link, a second call renews it, a folder of the user's own is left alone."""
    for name in ("one", "two"):
        (tmp_path / "repo" / "studies" / name).mkdir(parents=True)
        (tmp_path / "repo" / "studies" / name / "recordings.tsv").write_text("file\tparticipant_id\ttask\n")
    (tmp_path / "public" / "one").mkdir(parents=True)
    monkeypatch.setattr(cli, "REPO", tmp_path / "repo")
    for _ in range(2):
        done = CliRunner().invoke(cli.main, ["data", str(tmp_path / "public")])
        assert done.exit_code == 0, done.output
        assert "two: not in" in done.output
        assert (tmp_path / "repo" / "studies" / "one" / "raw").resolve() == tmp_path / "public" / "one"
    (tmp_path / "repo" / "studies" / "one" / "raw").unlink()
    (tmp_path / "repo" / "studies" / "one" / "raw").mkdir()
    assert "a folder of its own" in CliRunner().invoke(cli.main, ["data", str(tmp_path / "public")]).output


def test_adopt_writes_the_table(tmp_path: Path) -> None:
    """From the command line too, with the task given."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "P1_2.c3d").write_bytes(b"x")
    done = CliRunner().invoke(cli.main, ["adopt", str(tmp_path), "--pattern", "{participant}_{run}.c3d", "--task", "quiet"])
    assert done.exit_code == 0, done.output
    assert "P1_2.c3d\tP1\t\tquiet\t\t2" in (tmp_path / "recordings.tsv").read_text()
