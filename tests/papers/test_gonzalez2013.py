"""The study of Gonzalez 2013: handles count, the calibration beats table and paper in a few people, its bands hold, its text is right."""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from plumbline import recording
from plumbline.config import study_config
from plumbline.figures import _style
from plumbline.markerset import load
from plumbline.recording import Recording
from plumbline.sesc import of_part
from plumbline.simulate import gonzalez, wrenches
from plumbline.simulate import multi_contact as mc
from plumbline.simulate import nine_segments as nine
from plumbline.study import find

REPO = Path(__file__).resolve().parents[2]
STUDY = REPO / "studies" / "gonzalez2013"
sys.path.insert(0, str(STUDY))

from gonzalez2013 import chain, cohort, people, values  # noqa: E402
from gonzalez2013 import estimators as es  # noqa: E402
from gonzalez2013.figures import FIGURES  # noqa: E402

RATE = 20.0  # [Hz]
SEED = 4
TASKS = {"static": mc.paper, "volume": mc.volume, "sts": mc.sit_to_stand}


@pytest.fixture(scope="module")
def plan() -> people.Protocol:
    """The paper's protocol, and half of the poses of the extended one, at a tenth of the rate."""
    return people.protocol(10.0, 2)


@pytest.fixture(scope="module")
def few(plan: people.Protocol) -> pd.DataFrame:
    """Four people of the forty."""
    return cohort.measure(plan, nine.cohort(4))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Recording]]:
    """The study's files in short, and what the pipeline reads of them, by task."""
    folder = tmp_path_factory.mktemp("gonzalez")
    gonzalez.write(folder, SEED, {task: make(rate=RATE) for task, make in TASKS.items()})
    columns = study_config(STUDY)["columns"]
    return folder, {t.task: recording.assemble(t, columns=columns) for t in find(folder, "raw").trials}


# -- raw files through the pipeline -----------------------------------------------------------------------------------


def test_all_contacts_give_the_ground_projection(written: tuple[Path, dict[str, Recording]]) -> None:
    """Plates, handles and seat together tell the CoM's projection (eq. 12); without the hands it is off by centimetres."""
    folder, read = written
    given = values.scenes(read, load(STUDY / "markerset.yaml"))
    bias = nine.draw_subject(SEED).bias
    for task in ("static", "volume"):
        r = read[task]
        assert [p.foot for p in r.plates] == ["left", "right", "none", "none", "none"]
        assert r.mass == pytest.approx(70.0, rel=1e-3)
        true = values.truth(folder / "truth", r.trial.trial, r.time)
        ground = np.array([w.ground - given[task].at(w, true)[:2] for w in given[task].windows])
        np.testing.assert_allclose(ground.mean(axis=0), bias, atol=0.002)
        assert ground.std(axis=0).max() < 0.003
        assert len(given[task].still) > 0.9 * len(given[task].windows)
    record = mc.record(mc.paper(20.0, RATE), nine.draw_subject(SEED), white=0.0, coloured=0.0)
    alone = wrenches.projection([c for c in record.contacts if c.name.startswith("foot")])
    assert np.abs(alone - record.com[:, :2]).max() > 0.02


def test_the_stage_says_what_the_study_says(written: tuple[Path, dict[str, Recording]]) -> None:
    """The stage `sesc`, calibrated on the static task alone, gives the CoM that the study's own estimator gives."""
    _, read = written
    given = values.scenes(read, load(STUDY / "markerset.yaml"))
    settings = study_config(STUDY)["sesc"]
    made = of_part(read.values(), {}, str(STUDY / "markerset.yaml"), masses={}, **settings)["sesc"]
    com, sd = es.batch([given["static"]])(given["volume"])
    mine = made[made["task"] == "volume"]
    np.testing.assert_allclose(mine[[f"com_sesc_{a}" for a in "xyz"]], com, atol=2e-4)
    np.testing.assert_allclose(mine[[f"com_sesc_sd_{a}" for a in "xyz"]], sd, atol=2e-4)


def test_table_one_has_every_row(written: tuple[Path, dict[str, Recording]]) -> None:
    """Each printed number has ours beside it: mm, in the paper's axes; the calibrated CoM is as near as it says."""
    folder, read = written
    given = values.scenes(read, load(STUDY / "markerset.yaml"))
    true = {task: values.truth(folder / "truth", r.trial.trial, r.time) for task, r in read.items()}
    table = values.table_one(values.published(STUDY / "published.tsv"), given, values.fitted(given), true)
    assert len(table) == 16
    assert np.isfinite(table["batch"]).all()
    got = table.set_index(["item", "motion"])
    e = given["volume"].columns.table - true["volume"]
    assert got.loc[("rmse_forward", "volume"), "table"] == pytest.approx(1e3 * np.sqrt(np.mean(e[:, 1] ** 2)))
    com, sd = es.batch([given["static"]])(given["volume"])
    assert (np.abs(com - true["volume"]).max(axis=0) < 3 * sd.mean(axis=0)).all()
    assert got.loc[("rmse_up", "volume"), "batch"] < 0.2 * got.loc[("rmse_up", "volume"), "kalman_zero"]


# -- estimators ---------------------------------------------------------------------------------------------------------


def test_seven_parameters_hold_the_table(plan: people.Protocol) -> None:
    """The paper's chain of seven parameters makes the table's CoM to 1e-9 m in every pose of every motion."""
    for name, s in plan.scenes.items():
        np.testing.assert_allclose(s.root + s.basis @ s.table_parameters(), s.columns.table, atol=1e-9, err_msg=name)


def test_the_recursion_is_the_batch(plan: people.Protocol) -> None:
    """From the same prior, on the same rows, without drift or bounds, the paper's recursion ends where all rows at once do."""
    s = people.person(plan, nine.draw_subject(2)).scenes["static"]
    h = es.rows([s])
    recursion = es.kalman([s], s.table_parameters(), es.WEAK)(s)[0]
    both = es.sesc.batch(es.Prior(s.table_parameters(), es.WEAK**2 * np.eye(7)), h)
    np.testing.assert_allclose(recursion, s.root + s.basis @ both.mean, atol=1e-8)


def median(rows: pd.DataFrame, way: str, motion: str, value: str = "distance") -> float:
    """Over people, in mm."""
    return 1e3 * float(rows.loc[(rows["way"] == way) & (rows["motion"] == motion), value].median())


def test_people_are_told_better_than_by_table_and_paper(few: pd.DataFrame) -> None:
    """In four people: half the table's error, and less than the paper's recursion from zero or from a weak prior."""
    for motion in ("static", "volume", "sts"):
        assert median(few, "batch", motion) < 0.5 * median(few, "table", motion)
        assert median(few, "batch", motion) < 8.0
        assert median(few, "batch", motion) < min(median(few, w, motion) for w in ("kalman_zero", "kalman_weak"))
    assert median(few, "extended", "volume", "sd_z") < median(few, "batch", "volume", "sd_z")
    assert median(few, "extended, real", "extended") < 7.0


def test_the_vertical_is_a_matter_of_the_prior(few: pd.DataFrame) -> None:
    """With feet and hands fixed the vertical error follows what is believed of the start; the ground projection does not."""
    up = [median(few, f"from table, {sd:g} m", "static", "rms_z") for sd in (0.003, 0.02, 0.3)]
    ground = [median(few, f"from table, {sd:g} m", "static", "ground") for sd in (0.02, 0.3)]
    assert up[2] > 4 * up[1] > 4 * up[0]
    assert max(ground) < 4.0


def test_bands_hold(few: pd.DataFrame) -> None:
    """Upwards the predicted 95 % hold for nearly all people; with a prior four times too narrow they do not say enough."""
    mine = few[few["motion"] == "static"]
    assert mine.loc[mine["way"] == "batch", "cover_z"].mean() > 0.8
    narrow, usual = (mine.loc[mine["way"] == f"prior x {t}", "sd_z"].mean() for t in ("0.25", "1"))
    assert narrow < 0.6 * usual


def test_what_makes_it_worse(few: pd.DataFrame) -> None:
    """m a = F with the orientations' noise forgotten ruins a calibration; total least squares is no better than least squares."""
    assert median(few, "extended, real, m a = F", "extended") > 3 * median(few, "extended, real", "extended")
    least, total = (median(few, f"extended, real, {k}", "extended") for k in ("least squares", "total least squares"))
    assert total > 0.95 * least


def test_designed_holds_and_flags(plan: people.Protocol, few: pd.DataFrame) -> None:
    """Four poses of 5 s tell the vertical to 6 mm, 3.5 mm with one lying; it rests on the prior in the paper's protocol alone."""
    holds = cohort.designed(plan, 4).set_index(["among", "hold"])["sd_z"]
    assert holds["standing", 4] < 0.006
    assert holds["lie", 4] < 0.0035
    assert (holds.groupby("among").diff().dropna() < 0).all()
    flags = cohort.observed(plan, nine.cohort(1)).set_index("protocol")
    assert flags.loc["extended", "rests"] < flags.loc["static", "rests"]
    assert list(flags.loc[["static", "extended"], "observable"]) == [False, True]
    times = pd.DataFrame([("one fit from windows", 0.01, "s", "<= 0.2")], columns=["what", "value", "unit", "goal"])
    table = cohort.summary(few, cohort.covered(plan, 2), flags.reset_index(), cohort.designed(plan, 4), times)
    assert set(table["met"]) <= {"", "yes", "no"}
    assert np.isfinite(table["value"]).all()


# -- figures ------------------------------------------------------------------------------------------------------------


def test_figures_draw(written: tuple[Path, dict[str, Recording]], few: pd.DataFrame, plan: people.Protocol, tmp_path: Path) -> None:
    """Every figure draws from its tables and is a small vector file."""
    time = np.linspace(0.0, 2.0, 100)
    line = {f"{n}_{a}": np.full(100, 0.9 if a == "z" else 0.01 * i) for i, n in enumerate(("true", "table", "own")) for a in "xyz"}
    both = pd.concat([pd.DataFrame({"task": t, "time": time} | line | {f"sd_{a}": 0.005 for a in "xyz"}) for t in values.JUDGED])
    signals = pd.DataFrame({"task": "sts", "time": time, "limit_back": -0.1, "limit_front": 0.2})
    share = {"feet": np.linspace(100, 700, 100), "all": np.full(100, 700.0)}
    given = {"tracks": both, "stability": values.stable(signals, both, share), "people": few, "holds": cohort.designed(plan)}
    for name, sheet in FIGURES.items():
        draw = import_module(f"gonzalez2013.figures.{sheet.module}").draw
        _style.save(draw(**{t: given[t] for t in sheet.tables}), tmp_path / f"{name}.svg")
        assert 5_000 < (tmp_path / f"{name}.svg").stat().st_size < 1_000_000
    assert given["stability"]["own_margin"].dropna().to_numpy() == pytest.approx(0.12)


def test_readme_names_what_is_made() -> None:
    """Each figure and table that the rules make is in the README, and the markers are those that the simulator writes."""
    text = (STUDY / "README.md").read_text(encoding="utf-8")
    for name in (*(f"{f}.svg" for f in FIGURES), "table1.tsv", "cohort.tsv"):
        assert name in text
    made = gonzalez.markers(nine.joints(np.zeros((1, 3)), np.tile(np.eye(3), (1, 9, 1, 1))))
    assert set(study_config(STUDY)["columns"][0]["markers"]) == set(made)
    assert chain.LIMBS == nine.KINDS
