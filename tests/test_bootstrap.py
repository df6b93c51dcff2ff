"""`python -m plumbline run`: what it hands to Snakemake, without running it."""

from pathlib import Path

import pytest

from plumbline import bootstrap


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """Programs that would be called, with their arguments."""
    seen: list[tuple[str, ...]] = []

    def call(*command: str) -> int:
        seen.append(command)
        return 0

    monkeypatch.setattr(bootstrap, "_call", call)
    return seen


def test_a_relative_study_is_the_callers(calls: list[tuple[str, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`run .` means the folder one stands in, wherever the repository lies."""
    monkeypatch.chdir(tmp_path)
    assert bootstrap.run([".", "-c1"]) == 0
    ((program, *arguments),) = calls
    assert program == "snakemake"
    assert arguments[arguments.index("-d") + 1] == str(tmp_path)
    assert "-c1" in arguments
    assert not any(a.startswith("--cores") for a in arguments)


def test_the_demo_is_made_where_raw_holds_no_recording(
    calls: list[tuple[str, ...]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Side files do not count as recordings; a recording does."""
    monkeypatch.setattr(bootstrap, "REPO", tmp_path)
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "participants.tsv").write_text("participant_id\n")
    bootstrap.run([])
    assert [c[0] for c in calls] == ["plumbline", "snakemake"]
    (tmp_path / "raw" / "sub-1_task-a.c3d").write_bytes(b"")
    bootstrap.run([])
    assert [c[0] for c in calls] == ["plumbline", "snakemake", "snakemake"]


def test_an_absent_study_is_said(calls: list[tuple[str, ...]], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and the path; nothing is run."""
    assert bootstrap.run([str(tmp_path / "nowhere")]) == 2
    assert "no such folder" in capsys.readouterr().err
    assert calls == []


def test_it_needs_nothing_that_is_not_there_yet() -> None:
    """Set-up runs before anything is installed: standard library and modules of ours that hold to it."""
    import ast
    import sys

    own = {"plumbline.bootstrap", "plumbline.study", "plumbline.errors", "plumbline"}
    for name in ("bootstrap", "study", "errors", "__init__", "__main__"):
        tree = ast.parse((Path(bootstrap.__file__).parent / f"{name}.py").read_text())
        for node in tree.body:
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            modules += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            assert all(m in own or m.split(".")[0] in sys.stdlib_module_names for m in modules), (name, modules)
