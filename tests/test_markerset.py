"""Marker sets: loading, what is refused, what is only warned of, matching by labels."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from plumbline import body, markerset, segments
from plumbline.errors import PlumblineError
from plumbline.landmarks import landmarks_of
from plumbline.markerset import MarkerSet, load, match, named, parse

THIGH = {"proximal": ["RHIP"], "distal": ["RKNE"], "table": "de-leva-1996/thigh"}
LINE = {"at": ["A"], "from": ["A"], "to": ["B"], "share": 0.3}
OWN = {"proximal": ["A"], "distal": ["B"], "mass": 1.0, "com": 0.5, "gyration": 0.3}


def one(**spec: Any) -> MarkerSet:
    return parse({"segments": {"part": spec}}, "mine.yaml", "mine")


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        ({"segments": {"thigh_right": {**THIGH, "tabel": 1}}}, r"'thigh_right': unknown key 'tabel'; did you mean 'table'"),
        ({"segmets": {}}, r"mine.yaml.*"),
        ({"segments": {"thigh_right": {"distal": ["B"], "table": "x"}}}, r"segment 'thigh_right': 'proximal' is a required"),
        ({"segments": {"arm": {**OWN, "mass": 1.4}}}, r"segment 'arm', key 'mass': 1.4"),
        ({"segments": {"arm": {**OWN, "mass": "heavy"}}}, r"segment 'arm', key 'mass'"),
        ({"segments": {"arm": {**THIGH, "mass": 0.1}}}, r"segment 'arm', key 'table': give a table or own mass"),
        ({"segments": {"arm": {"proximal": ["A"], "distal": ["B"], "mass": 0.1}}}, r"segment 'arm', key 'com': missing"),
        ({"segments": {"arm": {**THIGH, "table": "de-leva-1996/leg"}}}, r"segment 'arm', key table 'de-leva-1996/leg': no row 'leg'"),
        ({"segments": {"arm": OWN}, "points": {"P": {"at": ["A"], "share": 1}}}, r"point 'P': keys \['at', 'share'\]"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "carried": ["B", "C"]}}}, r"point 'P', key 'carried': .* too short"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "carried": ["B", "C", "B"]}}}, r"point 'P', key 'carried': .*non-unique"),
        ({"segments": {"arm": OWN}, "points": {"P": {"mean": ["A"], "carried": [*"BCD"]}}}, r"point 'P': keys \['carried', 'mean'\]"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "share": {"F": 0.3}}}}, r"point 'P', key 'share': 'M' is a required"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "share": {"F": 1, "m": 1, "M": 1}}}}, r"key 'share': unknown key 'm'"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "upright": False}}}, r"point 'P', key 'upright': True was expected"),
        ({"segments": {"arm": OWN}, "points": {"P": {**LINE, "share": "half"}}}, r"point 'P', key 'share': 'half'"),
        ({"segments": {"arm": OWN, "leg": OWN}}, r"add up to 2.000"),
        (["arm"], r"holds no map"),
    ],
)  # fmt: skip
def test_a_malformed_set_is_refused_with_its_place(raw: Any, says: str) -> None:
    """The message names the file, the segment and the key."""
    with pytest.raises(PlumblineError, match=says) as error:
        parse(raw, "mine.yaml", "mine")
    assert str(error.value).startswith("mine.yaml")


def test_broken_yaml_is_refused_with_its_line(tmp_path: Path) -> None:
    """A file that is no YAML is named with the line."""
    file = tmp_path / "markerset.yaml"
    file.write_text("segments:\n  trunk: {proximal: [C7\n")
    with pytest.raises(PlumblineError, match=r"markerset.yaml: not readable as YAML.*line"):
        load(file)


@pytest.mark.parametrize(
    ("proximal", "distal", "table", "instead"),
    [
        (["C7"], ["RHIP", "LHIP"], "trunk", "de-leva-1996/trunk-c7"),
        (["CLAV"], ["RHIP", "LHIP"], "trunk-c7", "de-leva-1996/trunk"),
        (["RSHO", "LSHO"], ["RHJC", "LHJC"], "trunk", "de-leva-1996/trunk-shoulders"),
        (["r_knee"], ["r_lmal"], "shank", "de-leva-1996/shank-malleolus"),
    ],
)
def test_a_row_on_other_landmarks_is_refused(proximal: list[str], distal: list[str], table: str, instead: str) -> None:
    """The trunk from C7 with the row from the suprasternal notch is refused, and the row that fits is named."""
    with pytest.raises(PlumblineError, match=rf"key 'table'.*use {instead}$"):
        one(proximal=proximal, distal=distal, table=f"de-leva-1996/{table}")


def test_a_row_on_its_own_landmarks_passes_without_a_word() -> None:
    """Rows on labels that say their landmark leave no note; labels that say nothing leave one."""
    assert one(**THIGH).notes == ()
    assert "M17" in one(proximal=["M17"], distal=["RKNE"], table="de-leva-1996/thigh").notes[0]


def test_own_numbers_of_another_landmark_only_warn() -> None:
    """Own numbers equal to the notch's row between C7 and the hips are kept, with a note that names the right row."""
    mine = one(proximal=["C7"], distal=["PELV"], mass=0.4346, com=0.4486, gyration=0.372)
    assert mine.segments[0].numbers("F").com == 0.4486
    assert "de-leva-1996/trunk-c7" in mine.notes[0]
    assert one(proximal=["C7"], distal=["PELV"], mass=0.4346, com=0.5138, gyration=0.328).notes == ()


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        (["RHIP"], ("HJC",)), (["R.ASIS"], None), (["L_HJC", "R_HJC"], ("MIDH",)), (["LHIP"], ("HJC",)),
        (["RSHO", "LSHO"], ("MIDS",)), (["C7"], ("CERV",)), (["LMAL"], ("LMAL",)), (["LLMAL"], ("LMAL",)),
        (["left_knee"], ("KJC",)), (["RKNE", "RHIP"], None), (["RHIP", "RHIP"], None), (["hip_r"], ("HJC",)),
    ],
)  # fmt: skip
def test_labels_say_their_landmark(labels: list[str], names: tuple[str, ...] | None) -> None:
    """A label tells its landmark whatever the side's spelling; a pair of sides tells the middle; anything else tells nothing."""
    assert landmarks_of(labels) == names


@pytest.mark.parametrize("name", markerset.built_in())
def test_built_in_sets_are_sound(name: str) -> None:
    """Each built-in set loads without a note; left and right are mirror images; each segment can be had from the set's own markers."""
    mine = named(name)
    assert mine.notes == ()
    sides: dict[str, set[Any]] = {"left": set(), "right": set()}
    for s in mine.segments:
        for side in sides:
            if s.name.endswith(f"_{side}"):
                sides[side].add((s.name.removesuffix(f"_{side}"), s.table))
    assert sides["left"] == sides["right"]
    raw = {m for p in mine.points.values() for m in markerset.point_inputs(p)} | {m for s in mine.segments for m in s.markers}
    made = set(mine.points)
    assert mine.available(raw - made) >= {m for s in mine.segments for m in s.markers}


def test_a_mean_of_left_and_right_needs_both() -> None:
    """A segment is there only if each marker behind its made points is."""
    mine = named("plug-in-gait")
    labels = {m for p in mine.points.values() for m in markerset.point_inputs(p)} | {m for s in mine.segments for m in s.markers}
    labels -= set(mine.points)
    whole = mine.share(labels)
    assert whole == pytest.approx(1.0, abs=2e-4)
    assert mine.share(labels - {"LASI"}) < 0.2  # both hips, hence legs, trunk and the head's axis, need both ASIS
    assert mine.share({f"Anna:{x}" for x in labels}) == pytest.approx(whole)


@pytest.mark.parametrize("name", ["opencap", "plug-in-gait", "pds", "opensim-gait"])
def test_a_set_fits_files_without_the_markers_that_carry(name: str) -> None:
    """The share of the body and the set that is found do not depend on the markers that only carry."""
    mine = named(name)
    points = mine.points.values()
    needed = {m for p in points for m in markerset.point_inputs(p)} | {m for s in mine.segments for m in s.markers}
    needed -= set(mine.points)
    carry = {m for p in points for m in p.get("carried", ())}
    assert carry - needed
    assert mine.share(needed) == pytest.approx(mine.share(needed | carry))
    assert match(needed) == match(needed | carry) == name


@pytest.mark.parametrize("sex", ["F", "M", ""])
@pytest.mark.parametrize("name", ["opencap", "plug-in-gait", "pds", "opensim-gait"])
def test_a_straight_back_has_its_trunks_centre(name: str, sex: str) -> None:
    """Three pieces on one line weigh and balance as de Leva's whole trunk does: mass within 1e-4, CoM within 1 % of its length."""
    mine = named(name)
    row = "trunk" if name == "opensim-gait" else "trunk-shoulders"
    level = {p: markerset.share_of(mine.points[p], sex) for p in ("OMPH", "XYPH")}
    level["SUPR"] = 1.0 + (markerset.share_of(mine.points["SUPR"], sex) if "SUPR" in mine.points else 0.0)
    ends = {"pelvis": (level["OMPH"], 0.0), "abdomen": (level["XYPH"], level["OMPH"]), "thorax": (level["SUPR"], level["XYPH"])}
    got = [(s.numbers(sex), *ends[s.name]) for s in mine.segments if s.name in ends]
    mass = sum(n.mass for n, _, _ in got)
    whole = segments.numbers(f"de-leva-1996/{row}", sex)
    assert mass == pytest.approx(whole.mass, abs=1e-4)
    assert sum(n.mass * (a + n.com * (b - a)) for n, a, b in got) / mass == pytest.approx(1.0 - whole.com, abs=0.01)


def test_unknown_names_and_labels() -> None:
    """A misspelt set gets its nearest name; labels of no set match none."""
    with pytest.raises(PlumblineError, match="did you mean 'plug-in-gait'"):
        named("plugin-gait")
    assert match(["a", "b", "RKNE"]) == ""
    assert match([]) == ""


def test_hip_centres_of_a_square_pelvis() -> None:
    """Harrington's regression on a pelvis 240 mm wide and 160 mm deep, standing in the pipeline's axes, gives the hand-made numbers."""
    right, left, back = (np.array([v]) for v in ([0.12, 0.0, 1.0], [-0.12, 0.0, 1.0], [0.0, -0.16, 1.0]))
    forward, up, out = -0.24 * 0.16 - 0.0099, -0.30 * 0.24 - 0.0109, 0.33 * 0.24 + 0.0073
    np.testing.assert_allclose(body.hip_centre(right, left, back, "right")[0], [out, forward, 1.0 + up])
    np.testing.assert_allclose(body.hip_centre(right, left, back, "left")[0], [-out, forward, 1.0 + up])


@pytest.mark.parametrize(
    ("files", "task", "name", "share"),
    [
        (["c3d_wholebody/PiG_Motion-FlatFoot-Full.c3d"], "walk", "plug-in-gait", 1.0),
        (["nimble_subject4/static1.trc", "nimble_subject4/static1_grf.mot"], "quiet", "opencap", 1.0),
        (["c3d_wholebody/Walk1.c3d"], "walk", "helen-hayes", 1.0),
        (["opensim/walking2.c3d"], "walk", "opensim-gait", 0.9012),
        (["hidden_effect/clean/raw/sub-01/sub-01_task-lateral_run-01.c3d"], "lateral", "joint-centres", 1.0),
    ],
)
def test_public_recordings_find_their_set(shared_data: Path, files: list[str], task: str, name: str, share: float) -> None:
    """Labels of public recordings match the set made for them, which then covers the stated mass."""
    from plumbline.recording import assemble
    from plumbline.study import Trial

    got = assemble(Trial("t", "sub-01", "", task, "", "01", tuple(shared_data / f for f in files)))
    assert match(got.markers) == name
    assert body.build(got.markers, named(name), "M").share == pytest.approx(share, abs=2e-4)


def test_posture_data_set_has_just_enough_mass(shared_data: Path) -> None:
    """The set without arms matches its own labels and explains a little more than the 90 % that a CoM needs."""
    header = (shared_data / "pds" / "PDS13static.txt").read_text().splitlines()[0].split("\t")
    labels = {h.removesuffix("_X") for h in header if h.endswith("_X")}
    assert match(labels) == "pds"
    assert 0.90 < named("pds").share(labels, "M") < 0.92
