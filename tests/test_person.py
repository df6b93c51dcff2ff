"""A person is the same to the evidence, the formulas, the rungs and the law, and may stand anywhere in the laboratory."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from made_study import EVALUATION, Result

from plumbline import clusters, control, evidence, rungs, tables, trust
from plumbline.control_scene import Known, staged
from plumbline.effects import Catalogue, catalogue
from plumbline.effects._channels import Array, Channels, Person, persons
from plumbline.library import channels
from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study

AWAY = 1.0  # [m] from the laboratory's origin
KEY = {"subject": "sub-01", "task": "lateral", "condition": ""}
Tables = Mapping[str, pd.DataFrame]


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Tables:
    """One person about the laboratory's origin, three trials."""
    folder = tmp_path_factory.mktemp("person")
    write_study(folder, [draw_subject("sub-01", seed=2)], trials=3, duration=9.0, rate=100.0, force_rate=500.0, seed=2)
    got = Result(folder)
    return with_law({"signals": got.signals, "pushes": got.pushes, "loci": got.loci, "coverage": got.coverage})


@pytest.fixture(scope="module")
def away(here: Tables) -> Tables:
    """The same person 1 m to the right."""
    signals, loci = here["signals"].copy(), here["loci"].copy()
    places = [c for c in signals if c.startswith(("com", "zmp", "cop", "limit")) and c.endswith(("_x", "_left", "_right"))]
    signals[[c for c in places if "dot" not in c]] += AWAY
    loci["reference"] += AWAY
    return with_law({"signals": signals, "pushes": here["pushes"], "loci": loci, "coverage": here["coverage"]})


def with_law(made: Tables) -> Tables:
    """The tables, those that the control ledger reads besides among them."""
    four = [made[k] for k in ("signals", "pushes", "loci", "coverage")]
    trials = pd.DataFrame({"trial": made["signals"]["trial"].unique(), "events": "[]"})
    regimes, _ = trust.of_part(*four, trials, EVALUATION)
    members, _, controller = clusters.of_part(*four, regimes, EVALUATION)
    return {**made, "trust": regimes, "clusters": members, "controller": controller}


def alone(name: str, **change: object) -> Catalogue:
    """A catalogue of one effect."""
    return Catalogue({name: replace(catalogue()[name], **change)})


def judged(w2: float = 9.0) -> pd.DataFrame:
    """The row of `judged` that the rungs read."""
    return pd.DataFrame([{"subject": "sub-01", "axis": "lateral", "reason": "", "w2": w2, "h": 1 / w2}])


def free_runs(made: Tables, effects: Catalogue, name: str, windows: list[evidence.Weak]) -> pd.DataFrame:
    """Table `rungs` of one model, lateral."""
    signals, pushes, coverage = (made[k] for k in ("signals", "pushes", "coverage"))
    tried, about, table = tables.empty("candidates"), coverage.assign(files=""), evidence.to_table(windows)
    return rungs.of_part(signals, pushes, about, table, judged(), tried, effects, [(name, (name,))], EVALUATION)[0]


def law(made: Tables, effects: Catalogue, name: str) -> object:
    """What the laws are simulated against, an effect of the body known."""
    names = ("loci", "signals", "pushes", "coverage", "trust", "clusters", "controller")
    return staged(KEY, *(made[k] for k in names), Known({}, {name: [0.01]}, effects))


@pytest.mark.parametrize("trials", [3, 2])
def test_the_person_is_the_same_in_all_four_places(away: Tables, trials: int) -> None:
    """Evidence, library, rungs and law give an effect one height and one middle, also where coverage lists only some of the trials; the
    middle is that of all."""
    seen: set[tuple[float, float]] = set()

    def columns(c: Channels) -> Array:
        seen.add((c.height, c.middle))
        return np.asarray(c.com_x_dot[:, None])

    spy = alone("com_bias", columns=columns, undo=None, settled=False)
    made = {**away, "coverage": away["coverage"].sort_values("trial").head(trials)}
    signals, pushes, coverage = (made[k] for k in ("signals", "pushes", "coverage"))
    windows = list(evidence.of_part(signals, pushes, coverage, spy, EVALUATION, axis="lateral"))
    of_evidence = set(seen)
    of_library = {(c.height, c.middle) for c, _ in channels(windows, signals, coverage, spy)}
    seen.clear()
    law(made, spy, "com_bias")
    of_law = set(seen)
    seen.clear()
    free_runs(made, spy, "com_bias", windows)
    assert of_evidence == of_library == of_law == seen
    ((height, middle),) = seen
    assert height == pytest.approx(coverage["height_com"].mean())
    assert middle == pytest.approx(signals["zmp_x"].mean())
    assert middle == pytest.approx(AWAY, abs=0.05)


def test_a_study_beside_the_origin_has_the_same_rungs(here: Tables, away: Tables) -> None:
    """A scale of the CoM, counted from the person: weak error and free run do not change by a millionth."""
    effects, each = alone("com_bias"), []
    for made in (here, away):
        windows = evidence.of_part(made["signals"], made["pushes"], made["coverage"], effects, EVALUATION, axis="lateral")
        each.append(free_runs(made, effects, "com_bias", list(windows)))
    first, second = each
    assert list(first["trial"]) == list(second["trial"])
    assert len(first) == 3
    assert (first["free_run_frames"] > 100).all()
    for column in ("square_sum", "free_run_square_sum"):
        np.testing.assert_allclose(second[column], first[column], rtol=1e-6)


def test_a_study_beside_the_origin_has_the_same_law(here: Tables, away: Tables) -> None:
    """A scale of 20 % known to be in the record: the same errors and gains, the reference 1 m to the right."""
    first, second = (
        control.of_part(**made, evaluation=EVALUATION, corrected={"sub-01": {"com_bias": [0.2]}}, effects=alone("com_bias"))
        for made in (here, away)
    )
    assert set(first["reason"]) == {""}
    for column in ("square_sum", "zmp_square_sum", "k1", "k2"):
        np.testing.assert_allclose(second[column], first[column], rtol=1e-3)
    np.testing.assert_allclose(second["d"], first["d"] + AWAY, atol=1e-4)


def test_a_person_without_coverage_has_a_place_but_no_height(here: Tables) -> None:
    """The height is then that of the trial at hand."""
    got = persons(here["signals"], here["coverage"].iloc[:0])["sub-01"]
    assert isinstance(got, Person)
    assert np.isnan(got.height)
    assert got.middle["lateral"] == pytest.approx(0.0, abs=0.05)
