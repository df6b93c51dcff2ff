"""The criticism of the plant from windows to verdict: contacts, constants, channels that are absent, too few trials, the ladder's rungs."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from made_study import EVALUATION, Result

from plumbline import evidence, outer, rungs
from plumbline.constants import _Level, _moment
from plumbline.criticism import of_cohort, of_part, settled
from plumbline.effects import catalogue
from plumbline.false_discovery import false_discovery_rate
from plumbline.found import Finding
from plumbline.ladder import Said, ladder, verdict
from plumbline.physics import G
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study

EFFECTS = catalogue()
LAB = {"trials": 6, "duration": 10.0, "rate": 100.0, "force_rate": 500.0}


@cache
def disclosed(folder: Path) -> Result:
    return Result(folder)


def made(folder: Path, effects: dict[str, dict[str, float]], seed: int = 21, **laboratory: float) -> Result:
    """A simulated person with something hidden, written as files and read again."""
    write_study(folder, [draw_subject("sub-01", seed)], seed=seed, effects=effects, **{**LAB, **laboratory})
    return Result(folder)


def found(result: Result, drop: tuple[str, ...] = ()) -> Finding:
    """What the lateral axis lacks, some channels deleted."""
    signals = result.signals.assign(**dict.fromkeys(drop, np.nan))
    _, finding = settled(signals, result.pushes, result.coverage, EFFECTS, EVALUATION, "lateral")
    assert finding is not None
    return finding


def names(finding: Finding) -> set[str]:
    return {f.effect for f in finding.found}


# -- contacts beside the plates -----------------------------------------------------------------------------------------


def test_a_seat_is_found_by_itself(tmp_path: Path) -> None:
    """80 N carried 0.4 m to the left for 3 s of each trial: named `push`, its place within 2 cm, its load within a tenth; no other name."""
    got = found(made(tmp_path, {"push": {"lateral": 0.0, "force": 80.0, "x": -0.4, "duration": 3.0}}))
    assert names(got) == {"push"}
    (one,) = got.found
    assert one.parameters["x"][0] == pytest.approx(-0.4, abs=0.02)
    assert one.parameters["force"][0] == pytest.approx(80.0, rel=0.1)
    assert one.after < one.before / 5


def test_a_lean_to_the_side_is_found_by_itself(tmp_path: Path) -> None:
    """18 N to the right at 1.2 m: named `push`, its height within 5 cm."""
    got = found(made(tmp_path, {"push": {"lateral": 18.0, "height": 1.2, "duration": 3.0}}, seed=22))
    assert names(got) == {"push"}
    assert got.found[0].parameters["height"][0] == pytest.approx(1.2, abs=0.05)
    assert got.found[0].parameters["lateral"][0] == pytest.approx(18.0, rel=0.1)


@pytest.mark.parametrize("effect", [{"magnet": {"size": 14.0}}, {"friction": {"size": 9.0}}, {}])
def test_what_follows_the_body_is_no_contact(tmp_path: Path, effect: dict[str, dict[str, float]]) -> None:
    """A magnet, something that rubs, and nothing at all: no contact is named; only the first two leave something unexplained."""
    got = found(made(tmp_path, effect, seed=23))
    assert "push" not in names(got)
    assert bool(got.left or got.shapes) == bool(effect)


# -- constants ----------------------------------------------------------------------------------------------------------


def test_the_feet_tell_a_plate_from_a_com() -> None:
    """The CoP of both plates moved with the constant: offset. It stayed at the feet: com_bias. Nobody knows: both, and no name."""
    level = _Level(0.008, 0.0001, 0.008, 1e-6)
    assert _moment(level, [[-0.008, -0.009, -0.007]], alone=False).family == ("offset",)
    assert _moment(level, [[0.0, 0.001, -0.001]], alone=False).family == ("com_bias",)
    unknown = _moment(level, [[float("nan")] * 3], alone=False)
    assert (unknown.effect, unknown.family) == ("", ("offset", "com_bias"))
    assert _moment(level, [[float("nan")] * 3], alone=True).family == ("offset", "com_bias", "tilt")


def test_a_shift_of_the_plates_is_named_with_its_sign(tmp_path: Path) -> None:
    """p recorded 9 mm too large: b = 9 mm."""
    got = found(made(tmp_path, {"offset": {"b": 0.009}}, seed=24))
    assert [f.family[0] for f in got.found] == ["offset"]
    assert got.found[0].parameters["b"][0] == pytest.approx(0.009, abs=0.0005)


# -- channels -----------------------------------------------------------------------------------------------------------

SEGMENTS = ("ang_mom_x", "ang_mom_y", "ang_mom_z")


@pytest.mark.parametrize(
    ("study", "drop", "lacks", "says"),
    [
        ("ang_mom", SEGMENTS, "ang_mom", "ang_mom"),
        ("sync", ("grf_x", "grf_y"), "hand", "grf_x"),
        ("height", ("grf_x", "grf_y"), "force_scale", "grf_x"),
    ],
)
def test_what_lacks_its_channel_is_listed_and_never_named(
    shared_data: Path, study: str, drop: tuple[str, ...], lacks: str, says: str
) -> None:
    """Without segments, without shear: the effect that needs them says so and is not named."""
    got = found(disclosed(shared_data / "hidden_effect" / study), drop)
    (row,) = [c for c in got.candidates if c.effect == lacks]
    assert row.status == "lacking"
    assert "cannot be judged: needs" in row.reason
    assert says in row.reason
    assert lacks not in names(got)


@pytest.mark.parametrize(("study", "effect"), [("ang_mom", "ang_mom"), ("sync", "sync"), ("height", "height"), ("clean", "")])
def test_without_shear_what_can_still_be_known_is_named(shared_data: Path, study: str, effect: str) -> None:
    """Only the whole equation is left: the true effect or a family that holds it, and nothing on clean data."""
    got = found(disclosed(shared_data / "hidden_effect" / study), ("grf_x", "grf_y"))
    assert all(effect in f.family for f in got.found)
    assert bool(got.found) == bool(effect)


def test_without_the_vertical_force_the_verdict_stands(shared_data: Path) -> None:
    """The vertical is a witness; without it the moment side still tells angular momentum."""
    assert names(found(disclosed(shared_data / "hidden_effect" / "ang_mom"), ("grf_z",))) == {"ang_mom"}


# -- verdict and ladder --------------------------------------------------------------------------------------------------


def test_windows_survive_the_table(shared_data: Path) -> None:
    """Windows written as the table `evidence` and read again give the same terms."""
    got = disclosed(shared_data / "hidden_effect" / "sync")
    windows, _ = settled(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")
    again = list(evidence.from_table(evidence.to_table(windows)))
    assert [w.trial for w in again] == [w.trial for w in windows]
    for a, b in zip(windows, again, strict=True):
        assert set(a.terms) == set(b.terms)
        assert all(np.array_equal(a.terms[k][part], b.terms[k][part]) for k in a.terms for part in a.terms[k])
        assert a.centre["sync"] == pytest.approx(b.centre["sync"])


def test_one_trial_gives_no_verdict_and_says_what_is_needed(shared_data: Path) -> None:
    """missing is null, the reason names the number of trials."""
    got = disclosed(shared_data / "hidden_effect" / "ang_mom")
    few = got.coverage.head(1)
    table, alone, tried = of_part(got.signals, got.pushes, few, EFFECTS, EVALUATION)
    judged, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, EFFECTS)
    said = verdict(Said(ladder(got.heldout), few, got.heldout, judged, candidates), EVALUATION)
    assert said["plant"]["missing"] is None
    assert said["plant"]["unexplained"] is None
    assert "at least 2 trials" in said["plant"]["reason"]


def test_a_broken_effect_is_named_with_its_line_and_the_others_go_on(shared_data: Path, tmp_path: Path) -> None:
    """One that fails when read stands in the verdict, one that fails when it computes is not judged; both with the line."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "typo.py").write_text("import numpy as np\n\nEFFECT = Efect()\n", encoding="utf-8")
    late = "from plumbline.effects import Effect, Parameter\n\n\ndef columns(c):\n    return c.com_q\n\n\n"
    late += 'EFFECT = Effect("t", "plant", "e", "s", ("com_x",), (Parameter("k", "1"),), columns=columns)\n'
    (tmp_path / "effects" / "late.py").write_text(late, encoding="utf-8")
    effects = catalogue(tmp_path)
    got = disclosed(shared_data / "hidden_effect" / "ang_mom")
    table, alone, tried = of_part(got.signals, got.pushes, got.coverage, effects, EVALUATION)
    judged, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, effects)
    said = verdict(Said(ladder(got.heldout), got.coverage, got.heldout, judged, candidates), EVALUATION, effects)
    assert [m["effect"] for m in said["plant"]["missing"]] == ["ang_mom"]
    (line,) = said["broken_effects"]
    assert line.startswith("effects/typo.py: line 3: NameError")
    assert "line 5" in said["plant"]["cannot_judge"]["late"]


def test_each_rung_lowers_the_error_and_the_effect_is_what_lowers_it(shared_data: Path) -> None:
    """Angular momentum takes nine tenths off the weak error and half off the free run; a wrong effect takes off nothing."""
    got = disclosed(shared_data / "hidden_effect" / "ang_mom")
    table, alone, tried = of_part(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION)
    judged, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, EFFECTS)
    coverage = got.coverage.assign(files="")
    models = [("empty", ()), ("wrong", ("drift",)), ("right", ("ang_mom",))]
    rows, shown = rungs.of_part(got.signals, got.pushes, coverage, table, judged, candidates, EFFECTS, models, EVALUATION)
    rows = rows[rows["axis"] == "lateral"].groupby("model")[["square_sum", "windows", "free_run_square_sum", "free_run_frames"]].sum()
    weak = np.sqrt(rows["square_sum"] / rows["windows"])
    free = np.sqrt(rows["free_run_square_sum"] / rows["free_run_frames"])
    assert weak["right"] < 0.1 * weak["empty"]
    assert free["right"] < 0.5 * free["empty"]
    assert weak["wrong"] > 0.95 * weak["empty"]
    assert {"before", "after right", "effect ang_mom"} <= set(shown.columns)


def test_the_false_discovery_rate_is_the_textbooks() -> None:
    """Benjamini and Hochberg's steps on four p-values."""
    got = false_discovery_rate({"a": 0.01, "b": 0.02, "c": 0.03, "d": 0.5})
    assert got == pytest.approx({"a": 0.04, "b": 0.04, "c": 0.04, "d": 0.5})


def test_two_subjects_are_judged_together_and_alone(tmp_path: Path) -> None:
    """A sway of the trunk in both people: named for each and for all, with one size."""
    people = [draw_subject("sub-01", 31), draw_subject("sub-02", 32)]
    write_study(tmp_path, people, seed=31, effects={"ang_mom": {"amplitude": 0.05}}, **LAB)
    got = Result(tmp_path)
    table, alone, tried = of_part(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION)
    judged, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, EFFECTS)
    said = candidates[(candidates["axis"] == "lateral") & (candidates["status"] == "found")]
    assert said.groupby("subject")["effect"].agg(list).to_dict() == {s: ["ang_mom"] for s in ("all", "sub-01", "sub-02")}
    assert isinstance(judged, pd.DataFrame)


def test_a_load_that_somebody_carries_does_not_pass_for_body_mass(tmp_path: Path) -> None:
    """50 N carried for a third of each trial lowers what the plates say of the mass; the windows know it to 3 parts in a thousand."""
    got = made(tmp_path, {"push": {"lateral": 0.0, "force": 50.0, "x": -0.4, "duration": 3.0}})
    (subject,) = [draw_subject("sub-01", 21)]
    windows, _ = settled(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")
    plates = got.coverage["mass"].median()
    assert plates < 0.99 * subject.mass
    assert {round(w.mass, 6) for w in windows} == {round(windows[0].mass, 6)}
    assert windows[0].mass == pytest.approx(subject.mass, rel=3e-3)
    assert outer.masses(windows)[windows[0].trial] == pytest.approx(windows[0].mass, rel=1e-3)


def test_plates_that_read_more_in_one_trial_are_told(tmp_path: Path) -> None:
    """Forces 5 % too large in one of six trials: that trial is told with its share, without an interval; in two, with one.

    Of two trials nothing is said: it could be either.  What is larger than a scale can be is none.
    """
    got = made(tmp_path, {})
    first = got.signals["trial"].iloc[0]
    odd = got.signals["trial"] == first
    forces = [f"grf_{k}" for k in "xyz"]
    signals = got.signals.copy()
    signals.loc[odd, forces] *= 1.05
    windows, finding = settled(signals, got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")
    told = outer.scale(windows)
    assert finding is not None
    assert finding.found == []
    assert told is not None
    assert list(told.trials) == [first]
    assert told.trials[first] == pytest.approx(0.05, abs=0.003)
    assert told.s is not None
    assert np.isnan(told.s[1])
    assert outer.scale(windows[:2]) is None
    assert outer.scale(windows, possible=0.03) is None
    other = windows[1].trial
    two = [replace(w, vertical=w.vertical - 0.06 * G) if w.trial == other else w for w in windows]
    both = outer.scale(two)
    assert both is not None
    assert set(both.trials) == {first, other}
    assert both.s is not None
    assert both.s[1] < 0.055 < both.s[2]
    down = [replace(w, vertical=w.vertical + 0.06 * G) if w.trial == other else w for w in windows]
    apart = outer.scale(down)
    assert apart is not None
    assert apart.s is None
    assert outer.scale(settled(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")[0]) is None


def test_a_lever_is_found_as_well_as_a_strong_spring_needs(tmp_path: Path) -> None:
    """300 N/m at 1.2 m: 2 % of the lever are 0.2 mm of ZMP, which would pass for something that no effect explains."""
    got = found(made(tmp_path, {"hand": {"k": 300.0, "x": 0.02, "height": 1.2}}))
    assert names(got) == {"hand"}
    assert got.left == got.shapes == ()


def test_a_fault_that_is_the_shadow_of_a_damper_is_not_named(tmp_path: Path) -> None:
    """A damped hand of 12 N s/m looks like a late force record and a scale of the CoM: neither is named, something is unexplained."""
    got = found(made(tmp_path, {"hand_damper": {"c": 12.0, "height": 1.2}}, seed=24))
    assert names(got) == set()
    assert got.left or got.shapes


def test_times_at_which_a_contact_acts() -> None:
    """From half of the full force on; two times within one run are two; to the middle of a gap, and to the record's end."""
    frame = np.concatenate([np.arange(40, 200, 4), np.arange(300, 500, 4)])
    force = np.where((frame >= 80) & (frame <= 120), 20.0, 0.0) + np.where((frame >= 160) & (frame < 200), 20.0, 0.0)
    force += np.where(frame >= 460, 20.0, 0.0) + 0.1
    w = SimpleNamespace(trial="a", frame=frame, time=frame / 100.0)
    loud = np.ones(len(frame), bool)
    contact = outer.Contact((loud,), (force,), (np.zeros(len(frame)),), lateral=True, vertical=False)
    assert outer.spans([w], contact) == {"a": [(80, 120), (160, 248), (460, outer.LAST)]}  # type: ignore[list-item]


def test_a_contact_cut_short_by_the_end_of_the_record_counts_where_it_is_seen_elsewhere() -> None:
    """A run too short to be told alone is dropped inside a record, and kept beside a gap or an end if it acts in full there."""
    time = np.concatenate([np.arange(0, 2, 0.05), np.arange(4, 6, 0.05)])
    loud = np.zeros(len(time), bool)
    loud[10:14] = loud[36:40] = loud[-3:] = True
    assert not outer._runs(loud, time).any()
    full = loud & (time < 5)
    kept = outer._runs(loud, time, full=full)
    assert not kept[10:14].any()
    assert kept[36:40].all()
    assert not kept[-3:].any()
    assert outer._runs(loud, time, full=loud)[-3:].all()


@pytest.mark.parametrize(("q", "shift"), [(0.0, 0.0), (0.005, 0.0), (0.05, 0.0), (0.0, 0.006)])
def test_where_the_laboratorys_origin_lies_does_not_matter(shared_data: Path, q: float, shift: float) -> None:
    """A person 0.5 m from the origin: nothing on clean data; a scale of the CoP that shows is named as it is at the origin, a shift too."""
    got = disclosed(shared_data / "hidden_effect" / "clean")
    there = {c: got.signals[c] + 0.5 for c in ("com_x", "zmp_x", "cop_left_x", "cop_right_x", "limit_left", "limit_right")}
    there |= {c: (1 + q) * there[c] + shift for c in ("zmp_x", "cop_left_x", "cop_right_x")}
    _, finding = settled(got.signals.assign(**there), got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")
    assert finding is not None
    assert (finding.left, finding.shapes) == ((), ())
    if q > 0.01:
        assert names(finding) == {"gain"}
        assert finding.found[0].parameters["q"][0] == pytest.approx(q, abs=0.01)
    else:
        assert [f.family[0] for f in finding.found] == ["offset"] * bool(q + shift)
        assert not shift or finding.found[0].family == ("offset",)


def test_two_columns_of_one_parameter_are_told_and_not_used(shared_data: Path, tmp_path: Path) -> None:
    """An effect whose second column nobody bounds takes part in nothing; the reason says what is wanted."""
    (tmp_path / "effects").mkdir()
    text = "import numpy as np\nfrom plumbline.effects import Effect, Parameter\n\n\ndef columns(c):\n"
    text += "    return np.column_stack([c.com_x, c.zmp_x])\n\n\n"
    text += 'EFFECT = Effect("t", "plant", "e", "s", ("com_x", "zmp_x"), (Parameter("k", "1"),), columns=columns)\n'
    (tmp_path / "effects" / "two.py").write_text(text, encoding="utf-8")
    got = disclosed(shared_data / "hidden_effect" / "clean")
    _, finding = settled(got.signals, got.pushes, got.coverage, catalogue(tmp_path), EVALUATION, "lateral")
    assert finding is not None
    assert "2 columns, the effect has 1 Parameter" in finding.lacking["two"]
    assert names(finding) == set()


def test_a_model_that_cannot_be_computed_has_no_rung(shared_data: Path) -> None:
    """Without segments there is no rung with angular momentum: a number would be another model's."""
    got = disclosed(shared_data / "hidden_effect" / "ang_mom")
    signals = got.signals.assign(ang_mom_x=np.nan, ang_mom_y=np.nan, ang_mom_z=np.nan)
    table, alone, tried = of_part(signals, got.pushes, got.coverage, EFFECTS, EVALUATION)
    judged, candidates = of_cohort(dict(tuple(table.groupby("subject"))), alone, tried, EFFECTS)
    models = [("empty", ()), ("both", ("drift", "ang_mom")), ("drift", ("drift",))]
    rows, _ = rungs.of_part(signals, got.pushes, got.coverage.assign(files=""), table, judged, candidates, EFFECTS, models, EVALUATION)
    assert set(rows.loc[rows["axis"] == "lateral", "model"]) == {"empty", "drift"}


def test_one_time_that_the_record_cuts_short_does_not_hide_a_contact(shared_data: Path) -> None:
    """Ten even times and one that is all ramp scatter by less than a contact may; ten springs by more."""
    got = disclosed(shared_data / "hidden_effect" / "clean")
    windows, _ = settled(got.signals, got.pushes, got.coverage, EFFECTS, EVALUATION, "lateral")
    loud = [(w.time > w.time[0] + 0.5) & (w.time < w.time[-1] - 0.5) for w in windows]
    even = [np.full(len(w.time), 0.4) for w in windows]
    even[0] = np.linspace(0.1, 0.4, len(even[0]))
    assert outer._uneven(windows, even, loud) < outer.EVEN
    springs = [0.4 + 5 * (w.com - w.com.mean()) for w in windows]
    assert outer._uneven(windows, springs, loud) > outer.EVEN


def test_a_force_record_filtered_at_a_low_cut_off_leaves_nothing(tmp_path: Path) -> None:
    """2.6 Hz delay by 87 ms: as a delay alone it would be 90 ms and a flattened force; read as a filter the delay is right within 2 ms."""
    got = found(made(tmp_path, {"filter": {"cutoff": 2.6}}, seed=27))
    assert names(got) == {"sync"}
    assert "filter" in got.found[0].family
    assert got.left == got.shapes == ()
    assert got.found[0].parameters["delay"][0] == pytest.approx(np.sqrt(2) / (2 * np.pi * 2.6), abs=2e-3)
