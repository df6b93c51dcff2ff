"""Finding the trials of a study by name; parts that survive insertion."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbline.config import with_defaults
from plumbline.errors import REASONS, PlumblineError
from plumbline.study import Trial, assign, check_comparison, check_names, entities, find, forget_parts


def touch(*files: Path) -> None:
    for f in files:
        f.parent.mkdir(parents=True, exist_ok=True)
        f.write_text("x")


def test_bids_names_and_companions(tmp_path: Path) -> None:
    """A .trc and its .mot with the same entities are one trial; a session and a condition are kept; events are found."""
    folder = tmp_path / "raw" / "sub-A1" / "ses-b"
    stem = "sub-A1_ses-b_task-lateral_acq-held_run-02"
    touch(folder / f"{stem}.trc", folder / f"{stem}.mot", folder / f"{stem}_events.tsv")
    (trial,) = find(tmp_path).trials
    assert (trial.trial, trial.subject, trial.session, trial.task, trial.condition, trial.run) == (
        stem, "sub-A1", "b", "lateral", "held", "02",
    )  # fmt: skip
    assert [f.suffix for f in trial.files] == [".mot", ".trc"]
    assert trial.events is not None
    assert Trial.of(trial.plain()) == trial


@pytest.mark.parametrize("stem", ["walk01", "sub-01", "sub-01_run-1_task-a", "sub-01_task-a_foo-1", "sub-_task-a", "task-a_sub-01"])
def test_names_that_are_not_bids(stem: str) -> None:
    """Free names, unknown or misplaced entities are not guessed at."""
    assert entities(stem) is None


def test_nothing_is_passed_over(tmp_path: Path) -> None:
    """Every file is a trial, a side file, or named among the exclusions, a .mat and a nested one too."""
    raw = tmp_path / "raw"
    touch(raw / "walk.c3d", raw / "deep" / "er" / "x.mat", raw / "README.md", raw / "sub-01" / "sub-01_task-quiet_run-1.c3d")
    study = find(tmp_path)
    assert {e.file: e.reason for e in study.exclusions} == {"walk.c3d": "not_named", str(Path("deep/er/x.mat")): "not_named"}
    assert [t.trial for t in study.trials] == ["sub-01_task-quiet_run-1"]


def test_recordings_table_names_files(tmp_path: Path) -> None:
    """recordings.tsv stands in for names; a listed file that is absent and an unlisted one are both said."""
    touch(tmp_path / "raw" / "a b.c3d", tmp_path / "raw" / "other.c3d")
    (tmp_path / "recordings.tsv").write_text(
        "file\tparticipant_id\tsession\ttask\tacq\trun\na b.c3d\tsub-07\t\tquiet\tn/a\t1\ngone.c3d\t7\t\tquiet\t\t2\n"
    )
    study = find(tmp_path)
    assert [t.trial for t in study.trials] == ["sub-07_task-quiet_run-1"]
    assert {e.file: e.reason for e in study.exclusions} == {"gone.c3d": "missing_file", "other.c3d": "not_listed"}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("id\tmass_kg\n1\t70\n", "no column 'participant_id'"),
        ("participant_id\tmass_kg\n1\t70000\n", "is the unit right"),
        ("participant_id\tmass_kg\n1\tseventy\n", "line 2, column mass_kg"),
        ("participant_id\tsex\n1\tQ\n", "column sex"),
        ("participant_id\tmass\n1\t70\n", "did you mean 'mass_kg'"),
        ("participant_id\tsex\n1\tF\nsub-1\tF\n", "twice"),
    ],
)
def test_a_broken_participants_table_stops(tmp_path: Path, text: str, said: str) -> None:
    """The message names file, line, column and what to do."""
    touch(tmp_path / "raw" / "sub-1_task-a.c3d")
    (tmp_path / "raw" / "participants.tsv").write_text(text)
    with pytest.raises(PlumblineError, match=said):
        find(tmp_path)


def test_ids_with_and_without_sub_are_the_same_person(tmp_path: Path) -> None:
    """`1` and `sub-1` meet; n/a is no number."""
    touch(tmp_path / "raw" / "sub-1_task-a.c3d")
    (tmp_path / "raw" / "participants.tsv").write_text("participant_id\tmass_kg\theight_m\tsex\textra\n1\tn/a\t1.8\tfemale\thello\n")
    person = find(tmp_path).participants["sub-1"]
    assert (person.mass, person.height, person.sex) == (None, 1.8, "F")


@given(st.sets(st.integers(0, 999), min_size=1, max_size=60), st.integers(0, 999), st.integers(1, 9))
def test_inserting_a_subject_changes_one_part(numbers: set[int], new: int, size: int) -> None:
    """Whoever comes in, at most one part holds other subjects than before, and no part is too large."""
    before = assign([f"sub-{i:03d}" for i in numbers], size)
    after = assign([f"sub-{i:03d}" for i in numbers | {new}], size, before)

    def content(parts: dict[str, str]) -> dict[str, set[str]]:
        return {p: {s for s in parts if parts[s] == p} for p in parts.values()}

    changed = [p for p, who in content(after).items() if content(before).get(p) != who]
    assert len(changed) == (0 if new in numbers else 1)
    assert max(len(who) for who in content(after).values()) <= size


def test_a_cohort_is_hundreds_of_jobs() -> None:
    """1,000 subjects at the default size: 63 parts, with five stages and four figures each 567 jobs and the cohort's few."""
    size = with_defaults({})["subjects_per_job"]
    assert 9 * len(set(assign([f"sub-{i:04d}" for i in range(1000)], size).values())) < 1000


def test_names_in_the_config_are_known(tmp_path: Path) -> None:
    """A task, a trial id, a task with its run or a file's own name; anything else stops with the nearest one."""
    touch(tmp_path / "raw" / "STS1.trc")
    (tmp_path / "recordings.tsv").write_text("file\tparticipant_id\ttask\trun\nSTS1.trc\t4\tsts\t01\n")
    trials = find(tmp_path).trials
    check_names(trials, {"evaluation.test": ["sts", "STS1", "sub-4_task-sts_run-01", "sts_run-01"]})
    with pytest.raises(PlumblineError, match=r"evaluation\.train: .*did you mean 'STS1'"):
        check_names(trials, {"evaluation.train": ["STS2"]})


def test_every_reason_code_is_in_the_docs() -> None:
    """The table of reasons in docs/own-data.md is the closed list."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "own-data.md").read_text()
    assert [line.split("`")[1] for line in text.splitlines() if line.startswith("| `") and line.split("`")[1] in REASONS] == list(REASONS)


def test_comparisons_that_cannot_be_made_stop(tmp_path: Path) -> None:
    """train without test, or everything on both sides: said before anything is read."""
    touch(tmp_path / "raw" / "sub-1_task-a.c3d", tmp_path / "raw" / "sub-1_task-b.c3d")
    trials = find(tmp_path).trials
    check_comparison(trials, ["a"], ["b"])
    check_comparison(trials, [], ["b"])
    with pytest.raises(PlumblineError, match=r"needs evaluation\.test"):
        check_comparison(trials, ["a"], [])
    with pytest.raises(PlumblineError, match="nothing to fit on"):
        check_comparison(trials, ["a"], ["a", "b"])


def test_companions_with_a_suffix_and_names_that_look_like_side_files(tmp_path: Path) -> None:
    """`_grf.mot` belongs to its .trc; `changes_gait_01.c3d` and a script are named, README and events are not."""
    raw = tmp_path / "raw"
    touch(raw / "sub-1_task-sq_run-01.trc", raw / "sub-1_task-sq_run-01_grf.mot", raw / "changes_gait_01.c3d", raw / "make.py")
    touch(raw / "README.txt", raw / "sub-1_task-sq_run-01_events.tsv", raw / "LICENSE")
    study = find(tmp_path)
    assert [len(t.files) for t in study.trials] == [2]
    assert {e.file for e in study.exclusions} == {"changes_gait_01.c3d", "make.py"}


def test_a_link_back_up_ends(tmp_path: Path) -> None:
    """raw/loop -> raw: every file once."""
    touch(tmp_path / "raw" / "sub-1_task-a.c3d")
    (tmp_path / "raw" / "loop").symlink_to(tmp_path / "raw", target_is_directory=True)
    study = find(tmp_path)
    assert [len(t.files) for t in study.trials] == [1]
    assert study.exclusions == ()


@pytest.mark.parametrize(
    ("row", "said"),
    [("a.c3d\t\tq", "participant_id is empty"), ("a.c3d\t1\t", "task is empty"), ("a.c3d\t1\tq\na.c3d\t2\tq", "twice")],
)
def test_recordings_table_with_holes_stops(tmp_path: Path, row: str, said: str) -> None:
    """An empty id, an empty task, a file for two people: the line is named."""
    touch(tmp_path / "raw" / "a.c3d")
    (tmp_path / "recordings.tsv").write_text(f"file\tparticipant_id\ttask\n{row}\n")
    with pytest.raises(PlumblineError, match=said):
        find(tmp_path)


def test_parts_that_are_no_more_are_forgotten(tmp_path: Path) -> None:
    """Tables and figures of old parts go, so that a folder is one whole table; cohort files stay."""
    touch(*(tmp_path / f for f in ("loci/part-0001.parquet", "loci/part-0002.parquet", "loci/_part-0002.svg", "where/_all.svg")))
    gone = forget_parts(["part-0001"], tmp_path)
    assert sorted(f.name for f in gone) == ["_part-0002.svg", "part-0002.parquet"]
    assert (tmp_path / "where" / "_all.svg").exists()
