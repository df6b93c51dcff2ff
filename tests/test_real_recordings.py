"""What the plant ledger says of real recordings: a person who stands, squats and sits down on a seat that no plate measures."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from plumbline import evidence, outer, rungs
from plumbline.config import with_defaults
from plumbline.criticism import of_part, settled
from plumbline.effects import catalogue
from plumbline.physics import G
from plumbline.ranking import FAULT, motion
from plumbline.recording import assemble
from plumbline.signals import of_part as signals_of
from plumbline.signals import subject_masses
from plumbline.study import find

EVALUATION = with_defaults({"evaluation": {"half_width": 0.3, "exponent": 3, "offset": "train", "w2": "height"}})["evaluation"]
TASKS = {"static1": "static", "STS1": "sts", "squats1": "squats"}
WALKING = TASKS | {"walking1": "walk", "walkingTS1": "walk"}
LOAD = 479.0  # [N] mean of what the seat carries, from the vertical equation of a plain script
HIPS = ("L_HJC", "R_HJC")
FOUND = ["axis", "effect", "family", "before", "after"]


class Criticised:
    """The plant of one subject judged, from the files, with the tasks named as told."""

    def __init__(self, folder: Path, data: Path, tasks: dict[str, str]) -> None:
        rows = ["file\tparticipant_id\tsession\ttask\tacq\trun"]
        for run, (name, task) in enumerate(tasks.items(), 1):
            rows += [f"{name}{end}\tsub-04\t\t{task}\t\t{run:02d}" for end in (".trc", "_grf.mot")]
        (folder / "raw").symlink_to(data)
        (folder / "recordings.tsv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        (folder / "participants.tsv").write_text("participant_id\tmass_kg\theight_m\tsex\nsub-04\tn/a\tn/a\tn/a\n", encoding="utf-8")
        study = find(folder)
        self.recordings = [assemble(t) for t in study.trials]
        masses = subject_masses(pd.DataFrame([{"subject": "sub-04", "mass": r.mass} for r in self.recordings]))
        self.signals, self.coverage = signals_of(self.recordings, study.participants, "auto", cutoff=2.0, masses=masses)
        self.effects, self.pushes = catalogue(), pd.DataFrame(columns=["trial", "start", "end"])
        _, self.judged, self.tried = of_part(self.signals, self.pushes, self.coverage, self.effects, EVALUATION)

    def found(self) -> pd.DataFrame:
        """Rows of the candidates that were found."""
        return self.tried[self.tried["status"] == "found"]

    def windows(self, axis: str) -> list[evidence.Weak]:
        """Windows of all trials as they were judged."""
        return settled(self.signals, self.pushes, self.coverage, self.effects, EVALUATION, axis)[0]

    def contact(self, axis: str) -> tuple[list[evidence.Weak], outer.Contact | None]:
        """Windows, and the contact that is found among them."""
        windows = self.windows(axis)
        return windows, outer.find(windows, float(FAULT * motion([windows], ("kinematic",))[0]))


@pytest.fixture(scope="module")
def data(shared_data: Path) -> Path:
    folder = shared_data / "nimble_subject4"
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    return folder


@pytest.fixture(scope="module")
def person(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Criticised:
    return Criticised(tmp_path_factory.mktemp("person"), data, TASKS)


@pytest.fixture(scope="module")
def walker(data: Path, tmp_path_factory: pytest.TempPathFactory) -> Criticised:
    return Criticised(tmp_path_factory.mktemp("walker"), data, WALKING)


@pytest.fixture(scope="module")
def hips(person: Criticised) -> pd.DataFrame:
    """Middle of the hip joint centres while sitting down and up again: time [s], x, y [m]."""
    got = next(r for r in person.recordings if r.trial.task == "sts")
    middle = np.mean([got.markers[k] for k in HIPS], axis=0)
    return pd.DataFrame({"time": got.time - got.time[0], "x": middle[:, 0], "y": middle[:, 1]})


@pytest.mark.parametrize(("axis", "letter"), [("lateral", "x"), ("forward", "y")])
def test_seat_is_found_by_itself(person: Criticised, hips: pd.DataFrame, axis: str, letter: str) -> None:
    """`push` is named; its load lies within 5 % of body weight of the seat's, its line within 0.10 m of the hips while it carries."""
    found = person.found()
    row = found[(found["axis"] == axis) & (found["effect"] == "push")]
    assert len(row) == 1
    values = {k: v["value"] for k, v in json.loads(row["parameters"].iloc[0]).items()}
    assert values["force"] == pytest.approx(LOAD, abs=0.05 * 60.1 * G)
    windows, contact = person.contact(axis)
    assert contact is not None
    acts = np.concatenate([w.time[m] for w, m in zip(windows, contact.loud, strict=True)])
    load = np.concatenate([v[m] for v, m in zip(contact.load, contact.loud, strict=True)])
    sitting = float(np.average(np.interp(acts, hips["time"], hips[letter]), weights=np.maximum(load, 0.0)))
    assert abs(values["x"] - sitting) <= 0.10


@pytest.mark.parametrize("axis", ["lateral", "forward"])
def test_seat_acts_in_no_other_trial(person: Criticised, axis: str) -> None:
    """Nothing of the kind acts in the squats or in quiet standing, with the seat's trial beside them and without it."""
    windows, contact = person.contact(axis)
    assert contact is not None
    assert [w.task for w, m in zip(windows, contact.loud, strict=True) if m.any()] == ["sts"]
    others = [w for w in windows if w.task != "sts"]
    assert outer.find(others, float(FAULT * motion([others], ("kinematic",))[0])) is None


def test_nobody_is_accused_of_crosstalk(person: Criticised) -> None:
    """A measured force is a better x'' than the markers': a greedy search names crosstalk of 90 to 170 mm here."""
    found = person.found()
    assert not found["effect"].eq("crosstalk").any()
    assert not found["family"].str.contains("crosstalk").any()


def test_names_of_tasks_do_not_matter(person: Criticised, data: Path, tmp_path: Path) -> None:
    """With every task called `other` the same is found, of the same size."""
    mine, theirs = person.found(), Criticised(tmp_path, data, dict.fromkeys(TASKS, "other")).found()
    pd.testing.assert_frame_equal(theirs[FOUND].reset_index(drop=True), mine[FOUND].reset_index(drop=True))
    for a, b in zip(mine["parameters"].map(json.loads), theirs["parameters"].map(json.loads), strict=True):
        assert {k: [v["value"], *v["ci95"]] for k, v in b.items()} == {
            k: pytest.approx([v["value"], *v["ci95"]], rel=1e-6) for k, v in a.items()
        }


def test_small_faults_of_the_record_are_told_with_their_intervals(walker: Criticised) -> None:
    """The force record 7 +- 2 ms late and the plates of the walks 5.7 +- 0.5 % too large: sizes and intervals stand in the candidates."""
    for axis in ("lateral", "forward"):
        rows = walker.tried[walker.tried["axis"] == axis].set_index("effect")
        for name, parameter, size, within in (("sync", "delay", 7e-3, 2e-3), ("force_scale", "s", 0.057, 0.005)):
            assert rows.loc[name, "status"] == "settled"
            told = json.loads(rows.loc[name, "parameters"])[parameter]
            assert told["value"] == pytest.approx(size, abs=within)
            low, high = told["ci95"]
            assert 0 < low < size < high
            assert high - low < size
    said = walker.tried.loc[walker.tried["effect"] == "force_scale", "reason"].iloc[0]
    assert "walk_run-04" in said
    assert "static" not in said


AP, ML = "forward", "lateral"


@pytest.mark.parametrize(
    ("trained", "judged", "goals"), [("walkingTS1", "walking1", {ML: 8.0, AP: 9.0}), ("walking1", "walkingTS1", {ML: 10.0, AP: 9.5})]
)
def test_walking_with_the_shear(walker: Criticised, trained: str, judged: str, goals: dict[str, float]) -> None:
    """1.3 s of walking, told from the other walk: nothing is looked for in so little, and the user's models have their rungs.

    With the measured shear, angular momentum and height the error is less than a third of the base's (AP), than two thirds of it (ML).
    """
    chosen = {"train": [trained], "test": [judged], "half_width": 0.15, "exponent": 3, "offset": "train", "w2": "height"}
    evaluation = with_defaults({"evaluation": chosen})["evaluation"]
    files = {f"sub-04_task-{task}_run-{k:02d}": f"{name}.trc" for k, (name, task) in enumerate(WALKING.items(), 1)}
    coverage = walker.coverage.assign(files=walker.coverage["trial"].map(files))
    table, alone, tried = of_part(walker.signals, walker.pushes, coverage, walker.effects, evaluation)
    assert alone["reason"].str.contains("are needed").all()
    models = [("empty", ()), ("shear", ("shear", "ang_mom", "height"))]
    made, _ = rungs.of_part(walker.signals, walker.pushes, coverage, table, alone, tried, walker.effects, models, evaluation)
    error = {k: 1e3 * np.sqrt(r["square_sum"].sum() / r["windows"].sum()) for k, r in made.groupby(["axis", "model"])}
    for axis, goal in goals.items():
        assert error[axis, "shear"] <= goal
    assert error[AP, "shear"] < error[AP, "empty"] / 3
    assert error[ML, "shear"] < error[ML, "empty"] / 1.5
