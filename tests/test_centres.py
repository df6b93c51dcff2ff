"""CoM methods side by side."""

import numpy as np
import pandas as pd

from plumbline.centres import FROM_FORCE, METHODS, centres
from plumbline.physics import G
from plumbline.tables import TABLES, empty

RATE, MASS = 100.0, 70.0


def signals(scale: float = 1.2) -> pd.DataFrame:
    """Somebody who sways; the table's CoM moves `scale` times too far, the own one is right."""
    t = np.arange(2000) / RATE
    truth = np.column_stack(
        [0.02 * np.sin(2 * np.pi * 0.4 * t), 0.03 * np.sin(2 * np.pi * 0.3 * t), 1 + 0.01 * np.sin(2 * np.pi * 0.5 * t)]
    )
    a = np.gradient(np.gradient(truth, t, axis=0), t, axis=0) + np.array([0.0, 0.0, G])
    coms = {"com_table": truth * [scale, scale, 1.0], "com_others": truth, "com_force": truth, "com_fused": truth}
    out = {"trial": "a", "subject": "sub-01", "task": "sway", "frame": np.arange(len(t)), "time": t}
    for name, v in {**coms, "com_lab": np.full_like(truth, np.nan), "grf": MASS * a}.items():
        out |= {f"{name}_{k}": v[:, i] for i, k in enumerate("xyz")}
    return pd.DataFrame(out)


COVERAGE = pd.DataFrame({"trial": ["a"], "mass": [MASS]})


def ranked(frames: pd.DataFrame, poses: pd.DataFrame | None = None) -> pd.DataFrame:
    return centres(frames, COVERAGE, empty("poses") if poses is None else poses, half_width=0.4, exponent=4).set_index("method")


def test_newton_ranks_the_methods() -> None:
    """A table that moves a fifth too far leaves a fifth of the acceleration; the own CoM comes first; what is made from force has none."""
    got = ranked(signals())
    assert got.loc["sesc", "rank"] == 1
    assert got.loc["table", "rank"] == 2
    assert (got.loc[list(FROM_FORCE), ["rank", "rank_still"]] == 0).all().all()
    assert (got.loc[list(FROM_FORCE), "note"] != "").all()
    assert got.loc["sesc", "r_force_y"] < 0.02 * got.loc["table", "r_force_y"]
    assert "lab" not in got.index
    assert set(METHODS) >= set(got.index)


def test_a_seat_is_nobodys_fault() -> None:
    """A fifth of the weight on a seat for some seconds: those windows are left out for all methods alike."""
    with_seat = signals()
    with_seat.loc[800:1200, "grf_z"] *= 0.8
    got, plain = ranked(with_seat), ranked(signals())
    assert got.loc["sesc", "windows"] < plain.loc["sesc", "windows"]
    assert got.loc["sesc", "r_force_z"] < 0.02


def test_at_rest_the_distance_from_the_ground_projection_counts() -> None:
    """A still window whose ground projection lies 5 mm ahead of the CoM."""
    still = signals(1.0)
    place = still[still["time"].between(4.5, 5.5)]["com_table_y"].mean()
    row = {c.name: {"str": "", "float": 0.0, "bool": True}[c.kind] for c in TABLES["poses"]}
    row |= {"trial": "a", "subject": "sub-01", "time": 5.0, "length": 1.0, "ground_x": 0.0, "ground_y": place + 0.005}
    got = ranked(still, pd.DataFrame([row]))
    assert abs(got.loc["table", "static_y"] - 0.005) < 1e-4
    assert got.loc["table", "poses"] == 1
    assert sorted(got.loc[["table", "sesc"], "rank_still"]) == [1, 2]


def test_trials_that_calibrate_do_not_judge() -> None:
    """Where the config says which trials calibrate, the others alone are judged, for every method; alone they judge themselves."""
    seen, blind = signals(), signals(1.1).assign(trial="b", task="other")
    both = pd.concat([seen, blind], ignore_index=True)
    about = pd.DataFrame({"trial": ["a", "b"], "mass": [MASS, MASS]})
    options = {"half_width": 0.4, "exponent": 4, "tasks": ["sway"]}
    got = centres(both, about, empty("poses"), **options).set_index("method")
    alone = centres(blind, about, empty("poses"), **options).set_index("method")
    assert got.loc["table", "r_force_y"] == alone.loc["table", "r_force_y"]
    assert len(centres(seen, about, empty("poses"), **options))


def test_a_method_that_a_trial_lacks_is_not_ranked() -> None:
    """An own CoM in one of two trials is judged on half of the windows: shown, said, and without a rank."""
    other = signals().assign(trial="b")
    other[["com_others_x", "com_others_y", "com_others_z"]] = np.nan
    about = pd.DataFrame({"trial": ["a", "b"], "mass": [MASS, MASS]})
    both = pd.concat([signals(), other], ignore_index=True)
    got = centres(both, about, empty("poses"), half_width=0.4, exponent=4).set_index("method")
    assert got.loc["sesc", "rank"] == 0
    assert "fewer" in got.loc["sesc", "note"]
    assert got.loc["table", "rank"] == 1
