"""The workflow as a user runs it: a small study from raw files to the report, re-runs, parts, bad input."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from running import REPO, snakemake

from plumbline import tables
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study


def jobs(study: Path, repo: Path = REPO) -> dict[str, int]:
    """Rule -> number of jobs that a run would do."""
    done = snakemake(study, "-n", repo=repo)
    assert done.returncode == 0, done.stdout + done.stderr
    text = done.stdout + done.stderr
    lines = text[text.find("Job stats:") :].splitlines()[3:] if "Job stats:" in text else []
    found = {}
    for line in lines:
        parts = line.split()
        if len(parts) != 2 or parts[0] == "total":
            break
        found[parts[0]] = int(parts[1])
    return {k: n for k, n in found.items() if k != "all"}


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two subjects, two short trials each, already run; a file that cannot be read lies among them."""
    study = tmp_path_factory.mktemp("small")
    people = [draw_subject(f"sub-{i:02d}", seed=i) for i in (1, 3)]
    write_study(study, people, trials=2, duration=7.0, seed=1)
    (study / "raw" / "sub-01" / "sub-01_task-lateral_run-09.c3d").write_bytes(b"no c3d at all" * 100)
    (study / "raw" / "stray.mat").write_bytes(b"?")
    done = snakemake(study, "--config", "subjects_per_job=1")
    assert done.returncode == 0, done.stdout + done.stderr
    (study / "config.yaml").write_text("subjects_per_job: 1\n")
    return study


def test_every_stage_leaves_tables_with_units_and_digest(small: Path) -> None:
    """Parquet, one file per part, units in the metadata, the digest of the code, the config section; a folder is a whole table."""
    for name in ("trials", "markers", "plates", "signals", "coverage", "loci", "pushes", "fit", "heldout", "residuals", "where"):
        files = sorted((small / "results" / name).glob("*.parquet"))
        assert len(files) == 2, name
        about = tables.about(files[0])
        assert about["table"] == name
        assert about["code"]
        assert "config" in about
        units = {f.name: (f.metadata or {}).get(b"unit", b"?").decode() for f in pq.read_schema(files[0])}
        assert units == {c.name: c.unit for c in tables.TABLES[name]}
        assert len(pd.read_parquet(small / "results" / name)) == sum(pq.read_metadata(f).num_rows for f in files)


def test_the_interfaces_for_other_programs(small: Path) -> None:
    """verdict.json and ladder.parquet exist with the base row; two people who hide nothing are accused of nothing."""
    said = json.loads((small / "results" / "verdict.json").read_text())
    assert said["plant"]["missing"] == []
    assert said["plant"]["unexplained"] is False
    assert 0.05 < said["plant"]["base_error_mm"] < 1.0
    assert said["plant"]["noise_floor_mm"] == pytest.approx(said["plant"]["base_error_mm"], rel=0.3)
    ladder = pd.read_parquet(small / "results" / "ladder.parquet")
    assert set(ladder["model"]) == {"base"}
    assert (small / "results" / "report.html").stat().st_size > 10_000


def test_files_that_cannot_be_used_are_named(small: Path) -> None:
    """The broken C3D and the stray file stand in the exclusions with a reason; the others went on."""
    table = pd.read_parquet(small / "results" / "exclusions.parquet").set_index("file")
    assert table.loc["stray.mat", "reason"] == "not_named"
    assert table.loc["sub-01/sub-01_task-lateral_run-09.c3d", "reason"] == "unreadable"
    assert (table["hint"] != "").all()
    assert len(pd.read_parquet(small / "results" / "coverage")) == 4


def test_a_second_run_does_nothing(small: Path) -> None:
    """Nothing changed, nothing runs, and Snakemake's line says so."""
    assert jobs(small) == {}
    done = snakemake(small)
    assert "Nothing to be done" in done.stdout + done.stderr


def test_an_unrelated_key_reruns_nothing_and_a_related_one_what_depends_on_it(small: Path) -> None:
    """Asking for .csv files writes them and no more; the half width reaches fit and what follows, never the recordings."""
    config = small / "config.yaml"
    before = config.read_text()
    try:
        config.write_text(before + "markerset: auto\ncsv: true\n")
        assert jobs(small) == {"csv_tables": 1}
        config.write_text(before + "evaluation: {half_width: 0.35}\n")
        ran = set(jobs(small))
        assert {"fit", "residuals", "ladder"} <= ran
        assert not ran & {"recording", "signals", "loci", "exclusions"}
    finally:
        config.write_text(before)


def test_an_edited_module_reruns_what_depends_on_it(small: Path, tmp_path: Path) -> None:
    """A figure's module re-reads nothing; a model's module refits; a reader's module re-reads."""
    repo, study = tmp_path / "repo", tmp_path / small.name
    ignore = shutil.ignore_patterns(".venv", ".git", "results", "raw", ".snakemake", "studies", "__pycache__")
    shutil.copytree(REPO, repo, ignore=ignore)
    shutil.copytree(small, study)
    assert jobs(study, repo) == {}

    def edited(module: str) -> set[str]:
        file = repo / "plumbline" / module
        text = file.read_text()
        file.write_text(text + "\n# edited\n")
        try:
            return set(jobs(study, repo))
        finally:
            file.write_text(text)

    assert edited("figures/loci.py") == {"loci_figure", "report"}
    assert "fit" in edited("models/com_zmp.py")
    assert not edited("models/com_zmp.py") & {"recording", "signals", "loci"}
    assert {"recording", "signals", "fit", "report"} <= edited("readers/c3d.py")
    assert edited("simulate/human.py") == set()


def test_inserting_a_subject_reruns_one_part(small: Path, tmp_path: Path) -> None:
    """sub-02 comes between sub-01 and sub-03: one job per stage and the cohort's rules."""
    study = tmp_path / small.name
    shutil.copytree(small, study)
    assert jobs(study) == {}
    write_study(tmp_path / "more", [draw_subject("sub-02", seed=2)], trials=2, duration=7.0, seed=2)
    shutil.copytree(tmp_path / "more" / "raw" / "sub-02", study / "raw" / "sub-02")
    ran = jobs(study)
    assert all(ran[rule] == 1 for rule in ("recording", "signals", "loci", "fit", "residuals", "loci_figure", "ladder"))


def contents(folder: Path) -> dict[str, bytes]:
    """Tables, figures and pages: every byte that a reader might compare."""
    kinds = {".parquet", ".svg", ".html", ".json", ".tsv"}
    return {str(f.relative_to(folder)): f.read_bytes() for f in sorted(folder.rglob("*")) if f.suffix in kinds}


def test_one_core_and_two_leave_the_same_bytes(small: Path, tmp_path: Path) -> None:
    """The same study run again on one core: byte-identical tables, figures, verdict and report."""
    study = tmp_path / small.name  # the report shows the study's name
    shutil.copytree(small / "raw", study / "raw")
    shutil.copy(small / "config.yaml", study)
    assert snakemake(study, cores=1).returncode == 0
    first, second = contents(small / "results"), contents(study / "results")
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_raw_is_never_touched(small: Path, tmp_path: Path) -> None:
    """Names, bytes and times below raw/ are the same after a run, and raw/ may be a read-only link."""
    study, source = tmp_path / "linked", tmp_path / "source"
    shutil.copytree(small / "raw", source)
    for f in source.rglob("*"):
        f.chmod(0o555 if f.is_dir() else 0o444)
    source.chmod(0o555)
    study.mkdir()
    (study / "raw").symlink_to(source, target_is_directory=True)
    before = {str(f): (f.stat().st_size, f.stat().st_mtime_ns) for f in source.rglob("*")}
    try:
        assert snakemake(study, "results/verdict.json").returncode == 0
        assert {str(f): (f.stat().st_size, f.stat().st_mtime_ns) for f in source.rglob("*")} == before
        assert {f.name for f in study.iterdir()} <= {"raw", "results", ".snakemake"}
    finally:
        for f in [source, *source.rglob("*")]:
            f.chmod(0o755)


# -- bad input --------------------------------------------------------------------------------------------------------


def test_a_misspelt_key_stops_the_run(tmp_path: Path) -> None:
    """With a "did you mean"."""
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "x.c3d").write_text("")
    (tmp_path / "config.yaml").write_text("signal:\n  cutoff: 3\n")
    done = snakemake(tmp_path, "-n")
    assert done.returncode != 0
    assert "did you mean 'signals'" in done.stdout + done.stderr


def test_an_empty_raw_stops_and_says_so(tmp_path: Path) -> None:
    """Nothing to read is an error with advice."""
    (tmp_path / "raw").mkdir()
    done = snakemake(tmp_path, "-n")
    assert done.returncode != 0
    assert "holds no recording" in done.stdout + done.stderr


def test_a_study_whose_every_file_is_excluded_still_ends_well(tmp_path: Path) -> None:
    """Exit status 0, a report, one row per file, a verdict of nulls."""
    raw = tmp_path / "raw" / "sub-01"
    raw.mkdir(parents=True)
    (raw / "sub-01_task-quiet_run-1.c3d").write_bytes(b"")
    (raw / "holiday.c3d").write_bytes(b"")
    done = snakemake(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    table = pd.read_parquet(tmp_path / "results" / "exclusions.parquet")
    assert sorted(table["reason"]) == ["empty_file", "not_named"]
    said = json.loads((tmp_path / "results" / "verdict.json").read_text())
    assert said["plant"]["missing"] is None
    assert said["plant"]["base_error_mm"] is None
    assert "empty_file" in (tmp_path / "results" / "report.html").read_text(encoding="utf-8")
