"""Signals of one recording: its tables, support, what is said of a poor recording; public recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_recording import SOMEBODY, TRIAL, Plate, Recording, columns, pendulum, rod_set, run

from plumbline import tables
from plumbline.markerset import MarkerSet, load, match, named, parse
from plumbline.physics import G
from plumbline.signals import Signals, of_part, signals, subject_masses
from plumbline.study import Participant, Trial


def person(n: int = 600) -> Recording:
    """A rod that sways on two plates, with feet."""
    t, com, grf, zmp = pendulum(n)
    up = np.array([0.0, 0.0, 1.0])
    markers = {"A": com - 0.4 * up, "B": com + 0.6 * up}
    feet = {"LH": (-0.15, -0.08), "LT": (-0.2, 0.15), "RH": (0.15, -0.08), "RT": (0.22, 0.15)}
    markers |= {k: np.tile([x, y, 0.03], (n, 1)) for k, (x, y) in feet.items()}
    share = (0.15 - zmp[:, :1]) / 0.30
    plates = [
        Plate(t, grf * s, np.column_stack([np.full(n, x), zmp[:, 1], np.zeros(n)]), np.zeros(n), None, foot)
        for s, x, foot in ((share, -0.15, "left"), (1 - share, 0.15, "right"))
    ]
    return Recording(t, 100.0, markers, plates=plates, mass=70.0)


FEET = {"left": ["LH", "LT"], "right": ["RH", "RT"], "half_width": 0.02}


def test_a_recording_becomes_its_tables(tmp_path: Path) -> None:
    """Frames and coverage have exactly the columns of their tables and survive writing and reading."""
    got = run(person(), rod_set(**FEET))
    tables.write("signals", got.frames, tmp_path / "s.parquet")
    tables.write("coverage", pd.DataFrame([got.coverage | {"notes": "[]"}]), tmp_path / "c.parquet")
    pd.testing.assert_frame_equal(tables.read("signals", tmp_path / "s.parquet"), got.frames, check_dtype=False)
    assert got.coverage["com_method"] == "table"
    assert got.coverage["limitation"] == ""


def test_a_pendulum_obeys_its_equation_in_the_table() -> None:
    """In the columns, x'' = g/z (x - p) and F = m x'' hold away from the edges, to what the filter's reach leaves (1 mm/s2)."""
    f = run(person(3000), rod_set(**FEET)).frames
    inner = ~f["edge"]
    w2 = G / 0.95
    for a in "xy":
        rest = f[f"com_ddot_{a}"] - w2 * (f[f"com_lp_{a}"] - f[f"zmp_lp_{a}"])
        assert rest[inner].abs().max() < 1e-3
        assert (f[f"com_{a}"] - f[f"com_force_{a}"]).abs().max() < 2e-3
    assert f["grf_z"].mean() == pytest.approx(70.0 * G)


def test_support_limits_come_from_the_feet_on_the_floor() -> None:
    """Borders are the outermost markers widened as the set says; an unloaded foot on the floor counts, a lifted one does not."""
    who = person(1000)
    f = run(who, rod_set(**FEET)).frames
    for name, value in (("left", -0.22), ("right", 0.24), ("back", -0.10), ("front", 0.17)):
        np.testing.assert_allclose(f[f"limit_{name}"], value)
    who.plates[0].force[300:400] = 0.0
    who.plates[0].settle()
    who.plates[0].cop[300:400] = np.nan
    np.testing.assert_allclose(run(who, rod_set(**FEET)).frames["limit_left"], -0.22)
    for label in ("LH", "LT"):
        who.markers[label][300:400, 2] += 0.1
    f = run(who, rod_set(**FEET)).frames
    assert f["limit_left"][350] == pytest.approx(0.13)
    assert f["limit_left"][200] == pytest.approx(-0.22)


def test_a_foot_that_is_not_seen_leaves_the_support_unknown() -> None:
    """Where a foot's markers are missing it may stand: the limits are unknown, not those of the other foot."""
    who = person()
    for label in ("LH", "LT"):
        who.markers[label][100:120] = np.nan
    f = run(who, rod_set(**FEET)).frames
    np.testing.assert_array_equal(np.flatnonzero(f["limit_right"].isna()), np.arange(100, 120))


def test_support_falls_back_to_plates_and_says_so() -> None:
    """Without foot markers the plates' corners bound the support; without those nothing does."""
    who = person()
    for p in who.plates:
        p.corners = np.array([[0.3, 0.4, 0], [-0.3, 0.4, 0], [-0.3, -0.4, 0], [0.3, -0.4, 0.0]])
    bare = rod_set()
    got = run(who, bare)
    assert got.coverage["support"] == "plates"
    assert got.frames["limit_front"].iloc[0] == 0.4
    for p in who.plates:
        p.corners = None
    got = run(who, bare)
    assert got.coverage["support"] == "none"
    assert got.frames["limit_left"].isna().all()


def mirrored(who: Recording) -> Recording:
    """The same recording seen in a mirror: x turned round, left and right exchanged."""
    flip = np.array([-1.0, 1.0, 1.0])
    swap = {"L": "R", "R": "L"}
    markers = {swap.get(k[0], k[0]) + k[1:]: v * flip for k, v in who.markers.items()}
    other = {"left": "right", "right": "left"}
    plates = [replace(p, force=p.force * flip, cop=p.cop * flip, free_moment=-p.free_moment, foot=other[p.foot]) for p in who.plates]
    return replace(who, markers=markers, plates=plates[::-1])


def test_a_mirrored_recording_gives_mirrored_signals() -> None:
    """x changes its sign, left and right change places, angular momentum changes as an axial vector; nothing else changes."""
    here, there = run(person(), rod_set(**FEET)).frames, run(mirrored(person()), rod_set(**FEET)).frames
    swap = {"left": "right", "right": "left"}
    for c in tables.TABLES["signals"]:
        if c.kind != "float" or c.name == "time":
            continue
        parts = [swap.get(p, p) for p in c.name.split("_")]
        sign = -1.0 if parts[-1] == "x" or c.name in ("limit_left", "limit_right") else 1.0
        if c.name.startswith("ang_mom"):
            sign = -sign if parts[-1] == "x" else -1.0
        np.testing.assert_allclose(there["_".join(parts)], sign * here[c.name], atol=1e-9, err_msg=c.name)


def test_filled_markers_are_flagged_only_where_the_com_uses_them() -> None:
    """A filled rod marker flags its frame, a filled foot marker does not."""
    who = person()
    who.filled = {"A": np.arange(600) == 5, "LH": np.arange(600) == 9}
    np.testing.assert_array_equal(np.flatnonzero(run(who, rod_set(**FEET)).frames["filled"]), [5])


def test_forces_alone_give_a_com_and_say_what_it_cannot() -> None:
    """Without markers the CoM is that of the forces, its height from participants.tsv, and the limitation says where it stops."""
    who = replace(person(3000), markers={})
    got = run(who, None)
    assert got.coverage["com_method"] == "force"
    assert got.coverage["height_com"] == pytest.approx(0.56 * 1.75, abs=1e-3)
    assert "same forces as the ZMP" in got.coverage["limitation"]
    assert any("0.56 x 1.75 m" in n for n in got.notes)


def test_a_cop_alone_is_welcome_and_limited() -> None:
    """A CoP without forces gives its ZMP, no CoM, no mass, and a limitation; nothing fails."""
    t, _, _, zmp = pendulum()
    alone = Plate(t, np.full((3000, 3), np.nan), zmp, np.full(3000, np.nan))
    got = run(Recording(t, 100.0, plates=[alone]), None, Participant("sub-01"))
    np.testing.assert_allclose(columns(got.frames, "zmp"), zmp)
    np.testing.assert_allclose(got.frames["zmp_lp_x"], got.frames["zmp_x"], atol=2e-3)
    assert got.coverage["com_method"] == "none"
    assert "CoP without forces" in got.coverage["limitation"]
    assert "no CoM" in got.coverage["limitation"]


def test_the_labs_own_com_is_used_and_compared() -> None:
    """The file's CoM stands in where no segment does, and where both are their rms distance is given."""
    who = person()
    truth = who.markers["A"] + [0.0, 0.0, 0.4]
    who.derived = {"CentreOfMass": truth + np.array([0.003, 0.0, 0.004])}
    got = run(who, rod_set(**FEET))
    assert got.coverage["com_method"] == "table"
    assert got.coverage["lab_distance"] == pytest.approx(0.005)
    got = run(replace(who, markers={}), None)
    assert got.coverage["com_method"] == "lab"
    np.testing.assert_allclose(columns(got.frames, "com"), truth + np.array([0.003, 0.0, 0.004]))


def test_the_mass_comes_from_the_nearest_witness() -> None:
    """This trial's plates, else the subject's other trials, else participants.tsv, else unknown; each but the first is noted."""
    who = person()
    assert run(who, None).coverage["mass"] == 70.0
    who.mass = float("nan")
    assert signals(who, SOMEBODY, None, cutoff=2.0, subject_mass=71.0).coverage["mass"] == 71.0
    got = run(who, None, Participant("sub-01", 68.0))
    assert got.coverage["mass"] == 68.0
    assert any("participants.tsv" in n for n in got.notes)
    assert np.isnan(run(who, None, Participant("sub-01")).coverage["mass"])


def test_missing_segments_are_named_with_their_markers() -> None:
    """A set that finds only part of the body gives no CoM of its own and names what is missing."""
    who = person()
    who.plates = []
    mine = parse(
        {
            "segments": {
                "rod": {"proximal": ["A"], "distal": ["B"], "mass": 0.5, "com": 0.4, "gyration": 0.3},
                "hat": {"proximal": ["B"], "distal": ["TOP"], "mass": 0.5, "com": 0.4, "gyration": 0.3},
            }
        },
        "hat.yaml",
        "hat",
    )
    got = run(who, mine)
    assert got.coverage["missing_segments"] == "hat (TOP)"
    assert got.coverage["mass_share"] == 0.5
    assert got.coverage["com_method"] == "none"
    assert "segments of only 50%" in got.coverage["limitation"]


def test_a_part_holds_all_its_trials(tmp_path: Path) -> None:
    """Trials of a subject share the mass of those that tell it; a trial too slow for the filter has its reason and no frames."""
    second = replace(person(), mass=float("nan"), trial=replace(TRIAL, trial="second"))
    slow = replace(person(), trial=replace(TRIAL, trial="slow"))
    slow.time, slow.rate = slow.time * 50.0, 2.0
    masses = subject_masses(pd.DataFrame({"subject": "sub-01", "mass": [person().mass, float("nan"), 71.0, 69.0]}))
    frames, coverage = of_part([person(), second, slow], {"sub-01": SOMEBODY}, "auto", cutoff=2.0, masses=masses)
    assert list(frames["trial"].unique()) == [TRIAL.trial, "second"]
    assert list(coverage["mass"][:2]) == [70.0, 70.0]
    assert "other trials" in coverage["notes"][1]
    assert "2 Hz at 2 frames" in coverage["limitation"][2]
    tables.write("signals", frames, tmp_path / "s.parquet")
    tables.write("coverage", coverage, tmp_path / "c.parquet")
    nothing, row = of_part([slow], {}, "auto", cutoff=2.0, masses={})
    tables.write("signals", nothing, tmp_path / "s.parquet")
    assert len(row) == 1


# -- public recordings ------------------------------------------------------------------------------------------------


def recorded(folder: Path, *files: str, task: str = "quiet", who: Participant = SOMEBODY, markers: MarkerSet | None = None) -> Signals:
    from plumbline.recording import assemble

    got = assemble(Trial("t", "sub-01", "", task, "", "01", tuple(folder / f for f in files)))
    name = match(got.markers)
    return run(got, markers or (named(name) if name else None), who)  # type: ignore[arg-type]


def test_plug_in_gait_com_is_near_the_labs(shared_data: Path) -> None:
    """In a walking child the table's CoM lies 27 mm from Plug-in Gait's own, nearly all of it a constant distance behind it."""
    got = recorded(shared_data, "c3d_wholebody/PiG_Motion-FlatFoot-Full.c3d", task="walk")
    assert got.coverage["marker_set"] == "plug-in-gait"
    assert got.coverage["lab_distance"] == pytest.approx(0.0270, abs=5e-4)
    apart = columns(got.frames, "com_table") - columns(got.frames, "com_lab")
    assert np.nanstd(apart, axis=0).max() < 5e-3


def test_a_person_at_rest_stands_over_the_zmp(shared_data: Path) -> None:
    """In a static trial the table's CoM is within 15 mm (forward) and 4 mm (sideways) of the ZMP, and the forces' CoM within 4 mm of it."""
    f = recorded(shared_data, "nimble_subject4/static1.trc", "nimble_subject4/static1_grf.mot").frames
    apart = columns(f, "com") - columns(f, "zmp")
    assert abs(apart[:, 0].mean()) < 4e-3
    assert abs(apart[:, 1].mean()) < 15e-3
    own = columns(f, "com_force") - columns(f, "zmp")
    assert np.abs(own[:, :2].mean(axis=0)).max() < 4e-3


def test_a_lower_body_has_no_table_com(shared_data: Path) -> None:
    """Legs alone are 40 % of the mass: their set is found, the missing segments are named, the CoM is that of the forces."""
    got = recorded(shared_data, "c3d_wholebody/FunctionalStatic.c3d")
    assert got.coverage["mass_share"] == pytest.approx(0.397, abs=2e-3)
    assert got.coverage["com_method"] == "force"
    assert "head (LFHD, RFHD, LBHD, RBHD, C7)" in got.coverage["missing_segments"]
    assert got.frames["com_table_x"].isna().all()


def test_filtered_files_are_known(shared_data: Path) -> None:
    """Simulated sensors with white noise are raw; .trc and .mot that went through a low-pass are not."""
    where = shared_data / "hidden_effect" / "clean" / "raw"
    raw = recorded(where, "sub-01/sub-01_task-lateral_run-01.c3d", task="lateral", markers=load(where / "markerset.yaml"))
    assert raw.coverage["filtered_before"] is False
    for name in ("static1", "squats1", "walking1"):
        got = recorded(shared_data, f"nimble_subject4/{name}.trc", f"nimble_subject4/{name}_grf.mot", task="walk")
        assert got.coverage["filtered_before"] is True
        assert any("markers and forces were low-passed" in n for n in got.notes)


def test_the_moment_of_the_ground_is_the_rate_of_angular_momentum(shared_data: Path) -> None:
    """With a rolling trunk, (p - c) x F and dL/dt about the forward axis agree: slope 1 +- 0.05, correlation above 0.98."""
    from plumbline import filters

    where = shared_data / "hidden_effect" / "ang_mom" / "raw"
    got = recorded(where, "sub-01/sub-01_task-lateral_run-02.c3d", task="lateral", markers=load(where / "markerset.yaml"))
    t = got.frames["time"].to_numpy()
    moment = np.cross(columns(got.frames, "zmp") - columns(got.frames, "com"), columns(got.frames, "grf"))[:, 1:2]
    rate = filters.derivatives(filters.low_pass(columns(got.frames, "ang_mom")[:, 1:2], t, 3.0), t)[0]
    quiet = ((t > 1.7) & (t < 4.5)) | ((t > 5.8) & (t < 8.5))
    x, y = rate[quiet, 0], filters.low_pass(moment, t, 3.0)[quiet, 0]
    assert np.polyfit(x, y, 1)[0] == pytest.approx(1.0, abs=0.05)
    assert np.corrcoef(x, y)[0, 1] > 0.98


@pytest.mark.parametrize("name", ["walking1", "walkingTS1", "squats1", "STS1", "DJ1"])
def test_the_zmp_lies_over_the_feet_on_the_floor(shared_data: Path, name: str) -> None:
    """In gait, squats, sit-to-stand and a jump the ZMP is within the support but for one frame (a landing); in gait the support is
    one foot wide most of the time, and nothing but zero errors below 3 N is taken from the plates."""
    got = recorded(shared_data / "nimble_subject4", f"{name}.trc", f"{name}_grf.mot", task="walk")
    f = got.frames[got.frames["zmp_x"].notna()]
    outside = (f["zmp_x"] > f["limit_right"] + 0.01) | (f["zmp_x"] < f["limit_left"] - 0.01)
    assert outside.sum() <= 1
    width = float((f["limit_right"] - f["limit_left"]).median())
    assert width < 0.12 if name.startswith("walk") else width > 0.4
    assert not any("N there" in n and abs(float(n.split("mean ")[1].split(" N")[0])) > 3.0 for n in got.notes)
