"""Delimited text and parquet: the `columns:` grammar on real shapes of files, and its errors."""

from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pandas as pd
import pytest
import yaml

from plumbline.config import config_schema, with_defaults
from plumbline.errors import PlumblineError, Refused
from plumbline.readers import parquet, text

UNITS = {"time": "s", "length": "m", "force": "N", "moment": "N m"}
STUDIES = Path(__file__).resolve().parents[1] / "studies"


def entry(**keys: Any) -> list[dict[str, Any]]:
    """A `columns:` section with one entry for all files; checked against the schema like a config."""
    section = [{"files": "*", **keys}]
    jsonschema.Draft202012Validator(config_schema()["properties"]["columns"]).validate(section)
    return section


def put(path: Path, content: str) -> Path:
    """Write a text file."""
    path.write_text(content, encoding="utf-8")
    return path


def refusal(path: Path, columns: list[dict[str, Any]]) -> Refused:
    """The refusal of a file."""
    with pytest.raises(Refused) as caught:
        text.read(path, columns)
    return caught.value


BRACKETS = "Time[s]\tFx[N]\tFy[N]\tFz[N]\tCOPx[cm]\tCOPy[cm]\n0.01\t1\t2\t500\t-8\t4\n0.02\t1\t2\t500\t-8\t4\n0.03\t2\t1\t510\t-7\t5\n"


def test_units_in_brackets(tmp_path: Path) -> None:
    """Units in the header are honoured: a CoP in cm comes out in metres, in the wrench."""
    raw = text.read(put(tmp_path / "a.txt", BRACKETS), entry(time="Time", plates=[{"force": ["Fx", "Fy", "Fz"], "cop": "COP"}]))
    (plate,) = raw.plates
    cop = plate.origin[:2] + np.column_stack([-plate.moment[:, 1], plate.moment[:, 0]]) / plate.force[:, 2:]
    np.testing.assert_allclose(cop, [[-0.08, 0.04], [-0.08, 0.04], [-0.07, 0.05]])
    assert raw.rate == pytest.approx(100)
    assert raw.time.size == 0  # no frames of markers in a force file


def test_stem_and_list_say_the_same(tmp_path: Path) -> None:
    """`F` stands for Fx, Fy, Fz."""
    path = put(tmp_path / "a.txt", BRACKETS)
    one, two = (text.read(path, entry(time="Time[s]", plates=[{"force": f, "cop": ["COPx", "COPy"]}])) for f in ("F", [2, 3, "Fz[N]"]))
    np.testing.assert_array_equal(one.plates[0].force, two.plates[0].force)


def test_header_over_three_columns(tmp_path: Path) -> None:
    """`L_FAL,,,R_FAL,,` names two groups of three columns; `auto` takes both as markers."""
    raw = text.read(
        put(tmp_path / "m.csv", "L_FAL,,,R_FAL,,\n1,2,3,4,5,6\n1,2,3,4,5,7\n"), entry(rate=15, units={"length": "m"}, markers="auto")
    )
    assert raw.labels == ["L_FAL", "R_FAL"]
    np.testing.assert_array_equal(raw.points[1], [[1, 2, 3], [4, 5, 7]])
    np.testing.assert_allclose(raw.time, [0, 1 / 15])


def test_auto_leaves_what_others_use(tmp_path: Path) -> None:
    """Columns of the CoM and of plates are no markers; a CoM file without markers still has frames."""
    head = "time,COM_x,COM_y,COM_z,Foot_x,Foot_y,Foot_z,GRF_x,GRF_y,GRF_z,CP_x,CP_y,CP_z"
    rows = "\n".join(f"{0.01 * i:.2f},1,2,3,4,5,6,7,800,9,0.1,0,0.2" for i in range(4))
    raw = text.read(
        put(tmp_path / "a.csv", f"{head}\n{rows}\n"),
        entry(time="time", units=UNITS, markers="auto", com="COM", plates=[{"force": "GRF", "cop": "CP", "foot": "left"}]),
    )
    assert raw.labels == ["Foot"]
    np.testing.assert_array_equal(raw.derived["CentreOfMass"][0], [1, 2, 3])
    assert raw.plates[0].foot == "left"


@pytest.mark.parametrize(
    "content",
    ["0 1 2 3\n0.1 1 2 3\n", "# made by hand\n  0   1   2   3\n0.1   1   2   3\n", "t;x;y;z\n0,0;1,0;2,0;3,0\n0,1;1,0;2,0;3,0\n"],
)
def test_headerless_comments_and_decimal_commas(tmp_path: Path, content: str) -> None:
    """Columns by number work without a header, after comments, and with decimal commas between semicolons."""
    raw = text.read(put(tmp_path / "a.dat", content), entry(time=1, units=UNITS, markers={"M": [2, 3, 4]}))
    np.testing.assert_allclose(raw.time, [0, 0.1])
    np.testing.assert_allclose(raw.points[:, 0], [[1, 2, 3], [1, 2, 3]])


def test_vertical_force_alone(tmp_path: Path) -> None:
    """A force that is not recorded is NaN, not zero, and the CoP still comes out of Mx, My."""
    raw = text.read(
        put(tmp_path / "a.csv", "Time,Fz,Mx,My\n0,800,40,-16\n0.001,800,40,-16\n"),
        entry(time="Time", units=UNITS, plates=[{"force": [None, None, "Fz"], "moment": ["Mx", "My"]}]),
    )
    (plate,) = raw.plates
    assert np.isnan(plate.force[:, :2]).all()
    np.testing.assert_allclose([-plate.moment[0, 1] / 800, plate.moment[0, 0] / 800], [0.02, 0.05])


def test_cop_alone(tmp_path: Path) -> None:
    """A CoP without forces is kept as channels in metres."""
    raw = text.read(
        put(tmp_path / "a.csv", "Time,CoPx,CoPy\n0,1,2\n0.001,1,2\n"),
        entry(time="Time", units={"time": "s", "length": "mm"}, plates=[{"cop": "CoP"}]),
    )
    assert not raw.plates
    np.testing.assert_allclose(raw.channels["cop_y"], [0.002, 0.002])


def test_misspelt_column_names_the_nearest(tmp_path: Path) -> None:
    """A column that is not there is refused with the file and the nearest name."""
    caught = refusal(put(tmp_path / "a.txt", BRACKETS), entry(time="Tiem", plates=[{"force": "F", "cop": "COP"}]))
    assert caught.reason == "no_column"
    assert "a.txt" in caught.message
    assert "'Time'" in caught.hint


def test_column_number_beyond_the_last(tmp_path: Path) -> None:
    """A number beyond the last column is refused too."""
    assert refusal(put(tmp_path / "a.txt", BRACKETS), entry(time=17)).reason == "no_column"


def test_no_unit_is_guessed(tmp_path: Path) -> None:
    """A column whose unit stands nowhere is refused by name."""
    caught = refusal(put(tmp_path / "a.csv", "t,x,y,z\n0,1,2,3\n1,1,2,3\n"), entry(time="t", units={"time": "s"}, markers={"M": [2, 3, 4]}))
    assert caught.reason == "no_unit"
    assert "column x" in caught.message


def test_no_rate_no_reader(tmp_path: Path) -> None:
    """Neither time nor rate: refused; no entry for the file: refused."""
    path = put(tmp_path / "a.csv", "x,y,z\n1,2,3\n1,2,3\n")
    assert refusal(path, entry(units=UNITS, markers={"M": [1, 2, 3]})).reason == "no_rate"
    assert refusal(path, [{"files": "*.txt"}]).reason == "unsupported"


def test_a_word_in_a_used_column_only(tmp_path: Path) -> None:
    """Words in a column nobody named do no harm; in a named one they are refused with the row."""
    path = put(tmp_path / "a.csv", "t,phase,x,y,z\n0,up,1,2,3\n1,down,1,2,3\n")
    columns = entry(time="t", units=UNITS, markers={"M": [3, 4, 5]}, header=1)
    assert text.read(path, columns).points.shape == (2, 1, 3)
    assert refusal(path, entry(time="phase", units=UNITS, header=1)).reason == "unreadable"


def test_cut_text_file(tmp_path: Path) -> None:
    """A file that ends inside a row is refused as truncated."""
    assert refusal(put(tmp_path / "a.txt", BRACKETS[:-12]), entry(time="Time")).reason == "truncated"


def test_parquet_is_read_like_text(tmp_path: Path) -> None:
    """The same numbers as parquet and as CSV give the same recording; a damaged file is refused."""
    table = pd.DataFrame({"t": [0.0, 0.01, 0.02], "com_x": [1.0, 2, 3], "com_y": [0.0, 0, 0], "com_z": [1.0, 1, 1], "name": list("abc")})
    table.to_parquet(tmp_path / "a.parquet")
    table.drop(columns="name").to_csv(tmp_path / "a.csv", index=False)
    columns = entry(time="t", units=UNITS, com="com")
    one, two = parquet.read(tmp_path / "a.parquet", columns), text.read(tmp_path / "a.csv", columns)
    np.testing.assert_array_equal(one.derived["CentreOfMass"], two.derived["CentreOfMass"])
    (tmp_path / "b.parquet").write_bytes((tmp_path / "a.parquet").read_bytes()[:200])
    with pytest.raises(Refused) as caught:
        parquet.read(tmp_path / "b.parquet", columns)
    assert caught.value.reason == "unreadable"


def test_config_with_a_misspelt_key_says_did_you_mean() -> None:
    """A misspelt key in `columns:` stops the run with the nearest key."""
    with pytest.raises(PlumblineError, match="did you mean 'markers'"):
        with_defaults({"columns": [{"files": "*", "marker": "auto"}]})


@pytest.mark.parametrize("study", sorted(p.parent.name for p in STUDIES.glob("*/config.yaml")))
def test_configs_of_the_studies_are_valid(study: str) -> None:
    """Every committed study config fits the schema, and what it says stands against the defaults."""
    given = yaml.safe_load((STUDIES / study / "config.yaml").read_text(encoding="utf-8"))
    filled = with_defaults(given, study)
    assert set(filled) == set(config_schema()["properties"])
    for key, value in given.items():
        if isinstance(value, dict):
            assert {k: filled[key][k] for k in value if value[k] is not None} == {k: v for k, v in value.items() if v is not None}
        elif value is not None:
            assert filled[key] == value


@pytest.mark.parametrize(("study", "name", "column"), [("pds", "PDS13OR1grf.txt", "RGRF_Y"), ("bds", "BDS00001.txt", "Fz[N]")])
def test_public_sets_come_out_as_written(shared_data: Path, study: str, name: str, column: str) -> None:
    """With the study's config a force of the public file is read sample by sample."""
    config = yaml.safe_load((STUDIES / study / "config.yaml").read_text(encoding="utf-8"))
    plate = text.read(shared_data / study / name, config["columns"]).plates[0]
    wanted = pd.read_csv(shared_data / study / name, sep="\t")[column].to_numpy()
    np.testing.assert_allclose(plate.force[:, 1 if study == "pds" else 2], wanted)
