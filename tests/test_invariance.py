"""The same recording in other units, other axes, or seen in a mirror gives the same result, from the C3D file to omega."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np
import pandas as pd
import pytest
from made_study import EVALUATION, Result

from plumbline.fit import identify
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study

NUMBERS = ["omega", "omega_low", "omega_high"]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One person, three trials, with angular momentum hidden so that the errors are no mere noise."""
    folder = tmp_path_factory.mktemp("original")
    write_study(folder, [draw_subject("sub-01", seed=1)], trials=3, duration=9.0, seed=3, effects={"ang_mom": {}})
    return folder


@pytest.fixture(scope="module")
def first(original: Path) -> Result:
    return Result(original)


def rewritten(original: Path, folder: Path, change: Callable[[Any], None]) -> Result:
    """The study with every C3D file changed in place by `change`."""
    for source in sorted((original / "raw").rglob("*")):
        target = folder / source.relative_to(original)
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.suffix == ".c3d":
            c = ezc3d.c3d(str(source))
            change(c)
            c["data"]["meta_points"]["residuals"][:] = 0
            c.write(str(target))
        elif source.is_file():
            target.write_bytes(source.read_bytes())
    return Result(folder)


def in_metres(c: Any) -> None:
    c["data"]["points"][:3] /= 1000
    c["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    for key in ("CORNERS", "ORIGIN"):
        c["parameters"]["FORCE_PLATFORM"][key]["value"] = np.asarray(c["parameters"]["FORCE_PLATFORM"][key]["value"]) / 1000
    rows = [i for i, u in enumerate(c["parameters"]["ANALOG"]["UNITS"]["value"]) if u == "Nmm"]
    c["data"]["analogs"][0, rows] /= 1000
    c["parameters"]["ANALOG"]["UNITS"]["value"] = [u.replace("Nmm", "Nm") for u in c["parameters"]["ANALOG"]["UNITS"]["value"]]


def y_up(c: Any) -> None:
    """X forward, Y up, Z to the right, as many laboratories have it."""
    turn = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    c["data"]["points"][:3] = np.einsum("ij,jkt->ikt", turn, c["data"]["points"][:3])
    corners = np.asarray(c["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"])
    c["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"] = np.einsum("ij,jkp->ikp", turn, corners)


def mirrored(c: Any) -> None:
    """Left becomes right: x changes sign, labels change sides, plates keep their own axes (right, back, down)."""
    c["data"]["points"][0] *= -1
    other = {"L": "R", "R": "L"}
    labels = c["parameters"]["POINT"]["LABELS"]["value"]
    paired = {label for label in labels if label[0] in other and other[label[0]] + label[1:] in labels}
    c["parameters"]["POINT"]["LABELS"]["value"] = [other[x[0]] + x[1:] if x in paired else x for x in labels]
    corners = np.array(c["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"])
    corners[0] *= -1
    c["parameters"]["FORCE_PLATFORM"]["CORNERS"]["value"] = corners[:, [1, 0, 3, 2]]
    for i, label in enumerate(c["parameters"]["ANALOG"]["LABELS"]["value"]):
        if label[:2] in ("Fx", "My", "Mz"):
            c["data"]["analogs"][0, i] *= -1


@pytest.mark.parametrize("change", [in_metres, y_up])
def test_units_and_axes_do_not_matter(original: Path, first: Result, tmp_path: Path, change: Callable[[Any], None]) -> None:
    """mm or m with N mm or N m, z up or y up: omega to 1e-5, errors to 1e-3 (files hold single precision), the same loci."""
    second = rewritten(original, tmp_path, change)
    np.testing.assert_allclose(second.fit[NUMBERS], first.fit[NUMBERS], rtol=1e-5)
    np.testing.assert_allclose(second.heldout["square_sum"], first.heldout["square_sum"], rtol=2e-3)
    assert second.loci[["kind", "side", "start", "end"]].equals(first.loci[["kind", "side", "start", "end"]])
    assert second.axes == ({"x=+Z y=+X z=+Y"} if change is y_up else first.axes)


def test_a_mirrored_study_gives_mirrored_results(original: Path, first: Result, tmp_path: Path) -> None:
    """The same omega and errors, the opposite offset, left loci become right, limit_left and limit_right change places."""
    second = rewritten(original, tmp_path, mirrored)
    np.testing.assert_allclose(second.fit[NUMBERS], first.fit[NUMBERS], rtol=1e-5)
    np.testing.assert_allclose(second.heldout["square_sum"], first.heldout["square_sum"], rtol=2e-3)
    lateral = first.fit["axis"] == "lateral"
    np.testing.assert_allclose(second.fit.loc[lateral, "offset"], -first.fit.loc[lateral, "offset"], atol=1e-6)
    np.testing.assert_allclose(second.fit.loc[~lateral, "offset"], first.fit.loc[~lateral, "offset"], atol=1e-6)
    assert list(second.loci["side"]) == [{"left": "right", "right": "left"}[s] for s in first.loci["side"]]
    assert list(second.loci["kind"]) == list(first.loci["kind"])
    np.testing.assert_allclose(second.signals["limit_left"], -first.signals["limit_right"], atol=1e-6)
    np.testing.assert_allclose(second.signals["ang_mom_y"], -first.signals["ang_mom_y"], atol=1e-3)
    np.testing.assert_allclose(second.signals["cop_left_x"], -first.signals["cop_right_x"], atol=1e-5)


def test_omega_of_a_multibody_person_is_the_noise_free_weak_form_value(tmp_path: Path) -> None:
    """No omega was put into the multibody person; from files with noise it comes out as from its noise-free CoM and ZMP."""
    done = write_study(tmp_path, [draw_subject("sub-01", seed=4)], trials=4, duration=13.0, seed=4)
    measured = Result(tmp_path)
    truth, rows = measured.signals.copy(), []
    for trial, name in zip(done, sorted(truth["trial"].unique()), strict=True):
        index = truth.index[truth["trial"] == name]
        for column in ("com_x", "com_y", "com_z", "zmp_x", "zmp_y"):
            truth.loc[index, column] = trial.truth[column]
        rows += [{"trial": name, "start": t.onset, "end": t.onset + t.duration} for t in trial.touches]
    coverage = measured.coverage.assign(filtered_before=True)  # no noise to be taken off
    exact, _ = identify(truth, pd.DataFrame(rows), measured.loci, coverage, EVALUATION)
    chosen = (measured.fit["level"] == "subject") & (measured.fit["axis"] == "lateral")
    got, want = measured.fit[chosen].iloc[0], exact[(exact["level"] == "subject") & (exact["axis"] == "lateral")].iloc[0]
    assert got["omega"] == pytest.approx(want["omega"], rel=2e-3)
    assert got["omega_low"] <= want["omega"] <= got["omega_high"]
    assert want["omega"] < want["omega_height"]  # legs that lean under an upright trunk act like a smaller w2
