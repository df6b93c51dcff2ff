"""Segment tables: the printed numbers, and that rows for other landmarks mean the same body."""

from pathlib import Path

import numpy as np
import pytest

from plumbline import segments
from plumbline.errors import PlumblineError
from plumbline.segments import DE_LEVA, LANDMARKS

#: longitudinal lengths of de Leva 1996, table 4 [mm], female then male
LENGTHS = {
    "head": (200.2, 203.3), "head-c7": (243.7, 242.9), "trunk": (529.3, 531.9), "trunk-c7": (614.8, 603.3),
    "trunk-shoulders": (497.9, 515.5), "upper-trunk": (142.5, 170.7), "upper-trunk-c7": (228.0, 242.1),
}  # fmt: skip


@pytest.mark.parametrize(("sex", "file"), [("F", "BSPfemale_ZdeLeva.txt"), ("M", "BSPmale_ZdeLeva.txt")])
def test_the_table_holds_the_printed_numbers(shared_data: Path, sex: str, file: str) -> None:
    """Each row equals the row with the same landmarks in an independent transcription of de Leva's table."""
    rename = {"TSPH": "SPHY"}
    lines = (shared_data / "bmc" / file).read_text().splitlines()[1:]
    printed = {}
    for line in lines:
        _, ends, *values = line.split("\t")
        a, b = (rename.get(e.strip(), e.strip()) for e in ends.split("-"))
        printed[a, b] = [float(v) for v in values]
    assert len(printed) == len(DE_LEVA)
    for name, row in DE_LEVA.items():
        got = segments.numbers(f"de-leva-1996/{name}", sex)
        np.testing.assert_allclose(got, printed[row.proximal, row.distal], atol=1e-12, err_msg=name)


@pytest.mark.parametrize("sex", ["F", "M"])
@pytest.mark.parametrize(
    ("family", "end"),
    [
        (("trunk", "trunk-c7", "trunk-shoulders"), "distal"),
        (("head", "head-c7"), "proximal"),
        (("upper-trunk", "upper-trunk-c7"), "distal"),
    ],
)
def test_rows_for_other_landmarks_are_one_body(family: tuple[str, ...], end: str, sex: str) -> None:
    """With the paper's lengths, all rows of a segment put its CoM within 0.3 mm and its radii within 0.6 mm of each other."""
    at, spread = [], []
    for name in family:
        n = segments.numbers(f"de-leva-1996/{name}", sex)
        length = LENGTHS[name][sex == "M"]
        at.append((n.com if end == "proximal" else 1.0 - n.com) * length)
        spread.append([n.sagittal * length, n.transverse * length, n.longitudinal * length])
    assert np.ptp(at) < 0.3
    assert np.ptp(spread, axis=0).max() < 0.6


def test_a_whole_body_weighs_one() -> None:
    """Head, trunk and twice the limbs add up to the body within the rounding of the paper, and so do the trunk's three parts."""
    for sex in ("F", "M", ""):
        mass = {n: segments.numbers(f"de-leva-1996/{n}", sex).mass for n in DE_LEVA}
        limbs = sum(mass[n] for n in ("upper-arm", "forearm", "hand", "thigh", "shank", "foot"))
        assert mass["head"] + mass["trunk"] + 2.0 * limbs == pytest.approx(1.0, abs=2e-4)
        parts = mass["upper-trunk"] + mass["middle-trunk"] + mass["lower-trunk"]
        assert parts == pytest.approx(mass["trunk"], abs=2e-4)


def test_an_unstated_sex_is_the_mean_of_both() -> None:
    """Each number for sex "" lies midway between the two."""
    for name in DE_LEVA:
        f, m, mean = (segments.numbers(f"de-leva-1996/{name}", s) for s in ("F", "M", ""))
        np.testing.assert_allclose(mean, (np.array(f) + np.array(m)) / 2.0)


def test_every_landmark_is_explained() -> None:
    """Each landmark of the table has words."""
    assert {e for r in DE_LEVA.values() for e in (r.proximal, r.distal)} <= set(LANDMARKS)


@pytest.mark.parametrize(
    ("name", "sex", "says"),
    [("winter/thigh", "M", "de-leva-1996"), ("de-leva-1996/leg", "M", "shank"), ("de-leva-1996/thigh", "x", "'M', 'F'")],
)
def test_unknown_names_are_told(name: str, sex: str, says: str) -> None:
    """An unknown table, row or sex is refused with what exists."""
    with pytest.raises(PlumblineError, match=says):
        segments.numbers(name, sex)
