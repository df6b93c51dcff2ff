"""The stage: whole subjects in, own CoM and what is known of it out."""

import json
from functools import cache

import made_person
import numpy as np
import pandas as pd
from made_recording import Plate, Recording

from plumbline import tables
from plumbline.markerset import MarkerSet, parse
from plumbline.report import centre
from plumbline.sesc import of_part
from plumbline.simulate import multi_contact, nine_segments, routes
from plumbline.study import Participant, Trial

OPTIONS = {"tasks": (), "equations": ("still",), "window": 1.0, "limit": 0.002, "sides": "free", "prior": 1.0}


def _set() -> MarkerSet:
    """Nine segments between the joints of the simulated person."""
    body = made_person.body(nine_segments.joints(np.zeros((1, 3)), np.tile(np.eye(3), (1, 9, 1, 1))))
    ends = {"trunk": (["shoulder_l", "shoulder_r"], ["hip_l", "hip_r"])}
    for kind, (start, end) in made_person.ENDS.items():
        ends |= {f"{kind}_{side}": ([f"{start}_{letter}"], [f"{end}_{letter}"]) for side, letter in made_person.SIDES.items()}
    segments = {
        name: {"proximal": ends[name][0], "distal": ends[name][1], "mass": n.mass, "com": n.com, "gyration": 0.3}
        for name, n in zip(body.names, body.numbers, strict=True)
    }
    return parse({"segments": segments}, "nine.yaml", "nine")


def recording(protocol: str, person: nine_segments.Body, run: int = 1) -> Recording:
    """What a laboratory would have of it: joints as markers, one plate for the net wrench of all contacts."""
    motion = {"paper": lambda: multi_contact.paper(rate=10.0), "extended": lambda: routes.extended(rate=10.0)}[protocol]()
    r = multi_contact.record(motion, person, seed=run, white=0.001)
    force = made_person.forces(r)
    plate = Plate(r.time, force.grf, force.zmp, np.zeros(len(r.time)), None, "")
    trial = Trial(f"sub-01_task-{protocol}_run-0{run}", "sub-01", "", protocol, "", f"0{run}", ())
    return Recording(r.time, 10.0, dict(r.joints), plates=[plate], mass=person.mass, trial=trial)


@cache
def made() -> dict[str, pd.DataFrame]:
    person = nine_segments.cohort(1)[0]
    found = [recording("paper", person, 1), recording("extended", person, 2)]
    return run(found)


def run(recordings: list[Recording], **options: object) -> dict[str, pd.DataFrame]:
    import plumbline.sesc as stage

    original, stage.choose = stage.choose, lambda wanted, labels: _set()
    try:
        return of_part(recordings, {"sub-01": Participant("sub-01", 70.0)}, "auto", masses={"sub-01": 70.0}, **{**OPTIONS, **options})
    finally:
        stage.choose = original


def test_every_table_has_its_columns(tmp_path: object) -> None:
    """What the stage gives can be written as it stands."""
    for name, table in made().items():
        assert set(table.columns) == {c.name for c in tables.TABLES[name]}, name
        assert len(table), name


def test_what_others_tell_is_not_what_all_tell() -> None:
    """A trial's CoM by the other trials differs from that by all; both are nearer to the truth than the table."""
    sesc = made()["sesc"]
    mine = sesc[sesc["trial"] == "sub-01_task-extended_run-02"]
    truth = multi_contact.record(routes.extended(rate=10.0), nine_segments.cohort(1)[0], 2).com
    error = {k: np.linalg.norm(mine[[f"{k}_{a}" for a in "xyz"]].to_numpy() - truth, axis=1).mean() for k in ("com_sesc", "com_others")}
    assert 0 < error["com_sesc"] < error["com_others"] < 0.01


def test_a_task_that_is_not_asked_for_does_not_calibrate() -> None:
    """With `tasks: [paper]` the other trial's windows say so, and both ways to tell its CoM are the same."""
    person = nine_segments.cohort(1)[0]
    found = run([recording("paper", person, 1), recording("extended", person, 2)], tasks=["paper"])
    rest = found["poses"][found["poses"]["task"] == "extended"]
    assert not rest["used"].any()
    assert (rest["reason"] == "not among sesc.tasks").any()
    mine = found["sesc"][found["sesc"]["task"] == "extended"]
    assert np.allclose(mine["com_sesc_z"], mine["com_others_z"])
    assert not found["guidance"]["vertical_observable"].iloc[0]


def test_too_few_poses_give_wide_bands_and_the_pose_to_record() -> None:
    """Two seconds of standing: the bands stay near the table's, the flag is up, a pose is asked for; never a confident number."""
    one = recording("paper", nine_segments.cohort(1)[0])
    short = Recording(one.time[:20], 10.0, {k: v[:20] for k, v in one.markers.items()}, plates=one.plates, mass=70.0, trial=one.trial)
    for p in short.plates:
        p.time, p.force, p.cop, p.moment = p.time[:20], p.force[:20], p.cop[:20], p.moment[:20]
        p.free_moment = p.free_moment[:20]
    said = run([short])["guidance"].iloc[0]
    assert said["windows"] == 2
    assert said["sd_z"] > 0.8 * said["table_sd_z"]
    assert not said["vertical_observable"]
    steps = json.loads(said["next"])
    assert steps[0]["sd"][2] < said["sd_z"]
    assert said["learnt"] < 4


def test_without_plates_the_table_is_all_there_is() -> None:
    """No window can be used: no own CoM, each window says why, and the guidance stands."""
    one = recording("paper", nine_segments.cohort(1)[0])
    found = run([Recording(one.time, 10.0, one.markers, mass=70.0, trial=one.trial)])
    assert found["sesc"]["com_sesc_x"].isna().all()
    assert (found["poses"]["reason"] == "no centre of pressure in all of its frames").all()
    assert found["poses"]["sesc_error_x"].isna().all()
    assert found["guidance"]["windows"].iloc[0] == 0


def test_the_page_says_what_the_vertical_rests_on() -> None:
    """Own CoM, still windows and what to record next stand in the page's tables; an empty study says why there are none."""
    shown = centre.all_sheets(made())
    assert "told by the recordings" in shown["own"].rows[0]
    assert shown["own"].rows[0][-1].more
    assert any("used" in row for row in shown["poses"].rows)
    assert centre.all_sheets({})["own"].empty


def test_sides_can_be_tied() -> None:
    """`sides: tied` goes through the whole stage, the poses to record next included."""
    found = run([recording("paper", nine_segments.cohort(1)[0])], sides="tied")
    assert not found["chain"]["parameter"].str.contains("right|left").any()
    assert json.loads(found["guidance"]["next"].iloc[0])


def test_a_trial_with_other_segments_does_not_calibrate() -> None:
    """One marker lost in the first trial: its windows say so, the person is told by the others, who have all segments."""
    person = nine_segments.cohort(1)[0]
    odd = recording("paper", person, 1)
    del odd.markers["hand_l"]
    found = run([odd, recording("extended", person, 2), recording("paper", person, 3)])
    rows = found["poses"].set_index("trial").loc["sub-01_task-paper_run-01"]
    assert (rows["reason"] == "other segments are seen than in the subject's other trials").any()
    assert not rows["used"].any()
    assert found["guidance"]["windows"].iloc[0] > 0


def test_what_is_tested_does_not_calibrate() -> None:
    """Trials of `evaluation.test` are left out of the calibration unless `sesc.tasks` has them."""
    person = nine_segments.cohort(1)[0]
    found = run([recording("paper", person, 1), recording("extended", person, 2)], left_out=["extended"])
    rest = found["poses"][found["poses"]["task"] == "extended"]
    assert not rest["used"].any()
    assert rest["still"].any()
    assert (rest.loc[rest["still"], "reason"] == "left out: evaluation.test").all()
    assert rest["sesc_error_x"].notna().all()


def test_without_a_mass_nothing_is_still() -> None:
    """Neither plates nor participants.tsv tell the mass: nobody can say whether a hand was measured, and no window calibrates."""
    import plumbline.sesc as stage

    one = recording("paper", nine_segments.cohort(1)[0])
    one.mass = float("nan")
    original, stage.choose = stage.choose, lambda wanted, labels: _set()
    try:
        poor = of_part([one], {"sub-01": Participant("sub-01")}, "auto", masses={}, **OPTIONS)
        told = of_part([one], {"sub-01": Participant("sub-01", 70.0)}, "auto", masses={}, **OPTIONS)
    finally:
        stage.choose = original
    assert poor["poses"]["reason"].str.contains("body mass or vertical load not known").any()
    assert not poor["poses"]["used"].any()
    assert told["poses"]["used"].any()
