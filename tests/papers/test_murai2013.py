"""The study of Murai 2013: its simulated subject obeys what is prescribed, its numbers follow the truth, its README is right."""

import json
import shutil
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from plumbline import clusters, loci, signals, trust
from plumbline.config import study_config
from plumbline.figures import _style
from plumbline.recording import assemble
from plumbline.simulate import murai
from plumbline.study import find

REPO = Path(__file__).resolve().parents[2]
STUDY = REPO / "studies" / "murai2013"
sys.path.insert(0, str(STUDY))

from murai2013 import portrait, tracks, values  # noqa: E402
from murai2013.figures import FIGURES, comparison  # noqa: E402

SEED = 20130
MIX = {"unsaturated": 3, "saturated": 4, "beyond": 4, "falling": 1, "leaving": 2, "unrecovered": 1}  # 15 loci per condition
PAPER = values.published(STUDY / "published.tsv")


def other_truth() -> murai.Truth:
    """Another subject: frequencies and gains 3 to 12 % off the paper's, limits and reference elsewhere.

    A third of the full study's noise: with so few loci all of it would hide what follows what.
    """
    rng = np.random.default_rng(SEED)

    def moved(value: float, most: float) -> float:
        return float(value * (1 + most * rng.choice([-1, 1]) * rng.uniform(0.5, 1.0)))

    conditions = {}
    for acq, paper in murai.Truth().conditions.items():
        near = moved(paper.near, 0.06)
        conditions[acq] = murai.Condition(near * rng.uniform(0.75, 0.85), near, moved(paper.k1, 0.12), moved(paper.k2, 0.12))
    quiet = {"marker_noise": 3e-4, "cop_noise": 3e-4, "feedback_sd": 1e-3}
    return murai.Truth(conditions, left=-0.09, right=0.105, d=-0.006, **quiet)


# -- what the paper's own numbers reveal ------------------------------------------------------------------------------


def test_the_published_frequencies_put_the_com_too_high() -> None:
    """g/w2 is 2.19, 1.31, 1.24, 1.15 m; a man of 1.81 m has his CoM at 1.01 m (w = 3.1 rad/s)."""
    about = values.plausibility(PAPER)
    np.testing.assert_allclose(about["height"], [2.19, 1.31, 1.24, 1.15], atol=0.01)
    np.testing.assert_allclose(about["expected"], 1.01, atol=0.01)
    np.testing.assert_allclose(about["omega_expected"], 3.1, atol=0.02)


def test_a_lower_com_raises_omega() -> None:
    """With the CoM held at any lower height w is larger: the published explanation of the smaller w has the wrong sign."""
    heights = np.linspace(0.6, 1.2, 13)
    assert (np.diff([values.frequency(z) for z in heights]) < 0).all()
    about = values.plausibility(PAPER)
    assert (about["omega_low"] > about["omega_expected"]).all()
    assert (about["omega_expected"] > about["omega"]).all()


def test_what_the_far_loci_would_need() -> None:
    """w = 2.117 asks for z'' = -5.5 m/s2 at z = 0.95 m (0.7 m lower after half a second), or L' = 37 N m at x - p = 0.10 m."""
    far = values.plausibility(PAPER).set_index(["condition", "item"]).loc[("free", "omega_far")]
    assert far["z_ddot"] == pytest.approx(-5.55, abs=0.01)
    assert far["sink"] == pytest.approx(0.69, abs=0.01)
    assert far["ang_mom_rate"] == pytest.approx(37.3, abs=0.1)


def test_the_arithmetic_is_that_of_the_plant() -> None:
    """With that z'' or that L' a point mass of 70 kg accelerates as x'' = w2 (x - p) says, by its balance of forces and moments."""
    omega, lever, mass, g = 2.117, 0.1, 70.0, 9.81
    for z, z_ddot, spin in ((0.95, values.vertical(omega, 0.95), 0.0), (1.0, 0.0, values.ang_mom_rate(omega, 1.0, lever))):
        load = mass * (z_ddot + g)
        shear = (load * lever - spin) / z  # moments about the CoM: z Fx = (x - p) Fz - L'
        assert shear / mass == pytest.approx(omega**2 * lever, rel=1e-9)


def test_both_published_gain_sets_are_complex() -> None:
    """q1, q2 are conjugate, damping 0.69 and 0.73: real poles may not be forced."""
    about = values.damped(PAPER)
    np.testing.assert_allclose(about["damping"], [0.69, 0.73], atol=0.005)
    assert (about["q_imag"] > 0.5).all()
    q = about["q_real"] + 1j * about["q_imag"]
    np.testing.assert_allclose(np.abs(q) ** 2 + 1, about["k1"], rtol=1e-12)  # eq. 7
    np.testing.assert_allclose(2 * q.to_numpy().real / about["omega"], about["k2"], rtol=1e-12)


def test_the_readme_says_these_numbers() -> None:
    """Every number of the README's table of plausibility is the computed one."""
    text = (STUDY / "README.md").read_text(encoding="utf-8")
    for row in values.plausibility(PAPER).itertuples():
        assert f"| {row.omega:.3f} | {row.height:.3f} | {row.z_ddot:.2f} | {row.ang_mom_rate:.1f} |" in text


# -- the simulated subject --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def made() -> list[murai.Trial]:
    """One condition of the paper's subject, without sensor noise."""
    return murai.trials(murai.Truth(), "free", MIX, np.random.default_rng(SEED))


def test_quiet_standing_and_locus_obey_the_prescribed_plant(made: list[murai.Trial]) -> None:
    """Outside of the push the second difference of x is w2 (x - p), Fx/m; inside it the pusher's force begins and ends at zero."""
    step = 1 / 200
    for trial in made:
        second = (trial.x[2:] - 2 * trial.x[1:-1] + trial.x[:-2]) / step**2
        pushed = second - trial.a[1:-1]
        time = (1 + np.arange(len(second))) * step
        hands = (time > trial.onset) & (time < trial.onset + murai.PUSH)
        away = np.abs(time[:, None] - [trial.onset, trial.onset + murai.PUSH]).min(axis=1) > 2 * step
        # feedback noise moves p within a step by up to half a millimetre: 2 mm/s2
        assert np.abs(pushed[~hands & away]).max() < 0.02
        assert np.abs(pushed[hands]).max() > 0.1
        assert np.abs(pushed[hands][[0, -1]]).max() < 0.15 * np.abs(pushed[hands]).max()
        np.testing.assert_allclose(trial.a, trial.truth["omega"] ** 2 * (trial.x - trial.p), atol=1e-12)


def test_position_and_velocity_do_not_jump(made: list[murai.Trial]) -> None:
    """No two frames are further apart than the largest velocity allows, and the velocity changes as under a force of 1050 N at most."""
    for trial in made:
        velocity = np.diff(trial.x) * 200
        assert np.abs(velocity).max() < 1.5
        assert np.abs(np.diff(velocity)).max() < 15.0 / 200


def test_raw_is_never_replaced(tmp_path: Path) -> None:
    """Recordings that are there already stop the simulation."""
    (tmp_path / "raw" / "sub-01").mkdir(parents=True)
    (tmp_path / "raw" / "sub-01" / "mine.parquet").touch()
    with pytest.raises(FileExistsError):
        murai.write(tmp_path, mix=MIX)


# -- from raw files to the numbers, the truth out of reach ------------------------------------------------------------


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Tables of a small study of another subject, made while its truth lies elsewhere; `truth` is what lay there."""
    folder = tmp_path_factory.mktemp("murai2013")
    murai.write(folder, other_truth(), mix=MIX, seed=SEED)
    for name in ("config.yaml", "participants.tsv", "markerset.yaml"):
        shutil.copy(STUDY / name, folder / name)
    hidden = (folder / "truth.json").rename(tmp_path_factory.mktemp("elsewhere") / "truth.json")
    return _stages(folder) | {"truth": json.loads(hidden.read_text())}


def _stages(folder: Path) -> dict[str, Any]:
    """The pipeline in memory, from the files to the tables of the paper."""
    config, study = study_config(folder), find(folder)
    recordings = [assemble(t, columns=config["columns"]) for t in study.trials]
    trials = pd.DataFrame([{"trial": r.trial.trial, "events": json.dumps([list(e) for e in r.events])} for r in recordings])
    mass = pd.DataFrame({"subject": [r.trial.subject for r in recordings], "mass": [r.mass for r in recordings]})
    frames, coverage = signals.of_part(
        recordings, study.participants, str(study.markerset), cutoff=2.0, masses=signals.subject_masses(mass)
    )  # fmt: skip
    found, pushes = loci.of_part(frames, coverage, trials)
    weak = {k: config["evaluation"][k] for k in ("half_width", "exponent")}
    parts, rls = trust.of_part(frames, pushes, found, coverage, trials, weak)
    members, _, controller = clusters.of_part(frames, pushes, found, coverage, parts, weak)
    groups, chosen = values.groups(controller), tracks.examples(found, parts)
    return {
        "exclusions": study.exclusions, "signals": frames, "found": found, "controller": controller, "loci": members, "groups": groups,
        "portrait": portrait.of_controller(groups), "tracks": tracks.tracks(frames, found, members),
        "passes": tracks.passes(chosen, rls, frames), "switches": tracks.switches(chosen, parts),
        "numbers": values.numbers(PAPER, controller),
    }  # fmt: skip


def test_every_recording_is_used_and_every_locus_found(twin: dict[str, Any]) -> None:
    """No file is left out; each recording gives one locus, from where the mark of the push ends, of the kind that was simulated."""
    either = ("recovering", "recovering_from_beyond")  # one that begins at a limit may lie beyond the feet where the mark ends
    kinds = {"unsaturated": either[:1], "saturated": either, "beyond": either[1:]}
    kinds |= {"falling": ("falling",), "leaving": ("falling",), "unrecovered": ("unrecovered",)}
    told = {t["trial"]: t for t in twin["truth"]["loci"]}
    assert not twin["exclusions"]
    assert sorted(twin["found"]["trial"]) == sorted(told)
    for locus in twin["found"].itertuples():
        assert locus.start == pytest.approx(told[locus.trial]["start"] - murai.LATE, abs=1e-9)
        assert locus.kind in kinds[told[locus.trial]["kind"]], locus.trial


def test_the_numbers_follow_the_truth(twin: dict[str, Any]) -> None:
    """omega within 1 %, gains within 6 %, limits within 1 mm, the reference within 2 mm of another truth; not at the paper's values."""
    got = values.with_truth(twin["numbers"], twin["truth"]).set_index("item")
    for item, most in {"omega_far": 0.01, "omega_near": 0.01, "k1": 0.06, "k2": 0.06}.items():
        assert (got.loc[item, "error"].abs() < most * got.loc[item, "truth"]).all(), got.loc[item]
        assert (got.loc[item, "difference"].abs() > got.loc[item, "error"].abs()).all(), got.loc[item]
    for item, most in {"limit_left": 1e-3, "limit_right": 1e-3, "reference": 2e-3}.items():
        assert (got.loc[item, "error"].abs() < most).all(), got.loc[item]


def test_every_figure_draws_and_says_something(twin: dict[str, Any], tmp_path: Path) -> None:
    """Each figure of the paper is a vector file with data in it; none is an excuse."""
    for name, sheet in FIGURES.items():
        draw = import_module(f"murai2013.figures.{sheet.module}").draw
        figure = draw(**{t: twin[t] for t in sheet.tables}, **sheet.about)
        assert len(figure.axes[0].lines) + len(figure.axes[0].collections) >= 3, name
        _style.save(figure, tmp_path / f"{name}.svg")
        assert (tmp_path / f"{name}.svg").stat().st_size > 10_000
    drawn = comparison.draw(values.with_truth(twin["numbers"], twin["truth"]))
    assert len(drawn.axes) == 8


def test_figures_without_data_say_so(twin: dict[str, Any]) -> None:
    """Empty tables give a page with a reason, not an error."""
    for sheet in FIGURES.values():
        draw = import_module(f"murai2013.figures.{sheet.module}").draw
        figure = draw(**{t: twin[t].iloc[:0] for t in sheet.tables}, **sheet.about)
        assert figure.axes[0].texts


def test_only_the_comparison_opens_the_truth() -> None:
    """`truth.json` is named by the script of the comparison, by the rule that runs it and by who writes it; nowhere else in the code."""
    code = [f for place in ("plumbline", "scripts", "workflow", "studies/murai2013") for f in (REPO / place).rglob("*")]
    code = [f for f in code if f.suffix in (".py", ".smk", ".yaml") and "results" not in f.parts and "raw" not in f.parts]
    naming = {f.relative_to(REPO).as_posix() for f in code if "truth.json" in f.read_text(encoding="utf-8")}
    assert naming <= {
        "plumbline/simulate/murai.py",
        "studies/murai2013/make_raw.py",
        "studies/murai2013/paper.smk",
        "studies/murai2013/murai2013/values.py",  # says what with_truth is given
    }
    rules = (STUDY / "paper.smk").read_text(encoding="utf-8").split("\nrule ")
    assert [r.split(":")[0] for r in rules[1:] if "truth.json" in r] == ["comparison"]
    assert "truth" not in (STUDY / "paper_tables.py").read_text() + (STUDY / "paper_figure.py").read_text()
