"""The digest sees what a script depends on, and nothing else."""

from pathlib import Path

from plumbline import provenance
from plumbline.provenance import files_behind

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"


def names(script: str) -> set[str]:
    return {f.name for f in files_behind(SCRIPTS / script)}


def test_imports_are_followed_transitively() -> None:
    """fit.py of the scripts depends on the plant, the weak form and the model behind it."""
    assert {"fit.py", "plant.py", "weak.py", "com_zmp.py", "tables.py"} <= names("fit.py")


def test_a_figure_is_not_behind_a_recording() -> None:
    """Editing a figure re-reads nothing; editing a reader refits through its tables only."""
    assert not any("figures" in str(f) for s in ("recording.py", "signals.py", "fit.py") for f in files_behind(SCRIPTS / s))
    assert not any("readers" in str(f) for f in files_behind(SCRIPTS / "fit.py"))


def test_data_files_count_as_code() -> None:
    """The built-in marker sets decide the CoM, so they are behind `signals`."""
    assert "plug-in-gait.yaml" in names("signals.py")


def test_an_edit_changes_the_digest(tmp_path: Path) -> None:
    """One byte more, another digest."""
    script = tmp_path / "a.py"
    script.write_text("import plumbline.weak\n")
    before = provenance.digest(script)
    provenance.digest.cache_clear()
    provenance.files_behind.cache_clear()
    script.write_text("import plumbline.weak\n\n")
    assert provenance.digest(script) != before
