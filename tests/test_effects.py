"""The catalogue of effects: its contract, a study's own effects, and what the channels are."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import bilinear, butter, lfilter

from plumbline.effects import Channels, Effect, Parameter, catalogue
from plumbline.effects._channels import Person, derivative, of_trial

PLANT = {k: e for k, e in catalogue().items() if e.ledger == "plant"}
OWN = """
import numpy as np
from plumbline.effects import Effect, Parameter

def columns(c):
    return -c.com_x_dot[:, None]

EFFECT = Effect(
    title="Drag of a harness line", ledger="plant", equation="-c x'", source="this file",
    needs=("com_x",), parameters=(Parameter("c", "1/s", 0.0, 2.0),), columns=columns,
)
"""


def channels(seed: int = 1) -> Channels:
    """Smooth random channels of 4 s at 100 Hz."""
    rng = np.random.default_rng(seed)
    t = np.arange(400) / 100.0

    def wave(size: float) -> np.ndarray:
        return np.asarray(size * sum(rng.normal() * np.sin(rng.uniform(1, 6) * t + rng.uniform(0, 6)) for _ in range(4)))

    values = {"time": t, "com_x": wave(0.03), "zmp_x": wave(0.05), "com_z": 0.95 + wave(0.01), "ang_mom": wave(1.0)}
    values |= {"grf_x": wave(20.0), "grf_z": 700.0 + wave(10.0)}
    values |= {
        name: wave(0.1) for name in ("com_y", "zmp_y", "grf_y", "hand_x", "hand_z", "com_lp_x", "com_dot_x", "com_ddot_x", "zmp_lp_x")
    }
    values |= {f"com_{name}_{a}": wave(0.02) for name in ("table", "others") for a in "xyz"}
    return Channels(values, 100.0, 70.0, 1.0)


@pytest.mark.parametrize("name", PLANT)
def test_columns_have_the_shape_of_the_trial_and_are_affine_in_w2(name: str) -> None:
    """Moment and kinematic columns have one row per frame and the same number of columns; the moment side is affine in w2."""
    effect = PLANT[name]
    assert effect.columns is not None
    c = channels()
    a, b, d = (effect.columns(Channels(c.values, c.rate, c.mass, c.height, w2)) for w2 in (0.0, 1.0, 3.0))
    assert a.ndim == 2
    assert len(a) == 400
    np.testing.assert_allclose(d, a + 3.0 * (b - a), rtol=1e-9, atol=1e-12)
    if effect.force is not None:
        assert effect.force(c).shape == a.shape


@pytest.mark.parametrize("name", PLANT)
def test_every_effect_says_what_it_is(name: str) -> None:
    """Title, equation, source, channels, units, what it is confounded with and what separates them; other effects it names exist."""
    effect = PLANT[name]
    assert all((effect.title, effect.equation, effect.source, effect.needs, effect.separated))
    assert all(other in catalogue() for other in effect.confounded)
    for parameter in effect.parameters:
        assert parameter.unit
        assert parameter.lower < parameter.upper
        assert parameter.physics is None or not parameter.refusal(parameter.physics)


@pytest.mark.parametrize("name", [k for k, e in PLANT.items() if e.undo is not None])
def test_undo_takes_out_what_the_columns_describe(name: str) -> None:
    """To first order, what a small amount of an effect adds to x'' - w2 (x - p) and to x'' - F/m is its columns times the amount."""
    effect = PLANT[name]
    c = channels()
    c = Channels(c.values, c.rate, c.mass, c.height, 9.0)
    amount = np.array([1e-4])
    clean = effect.undo(c, effect.of_coefficients(amount))  # type: ignore[misc]
    assert effect.columns is not None
    assert effect.force is not None or name == "gain"

    def plant(one: Channels) -> np.ndarray:
        return np.asarray(one.com_x_ddot - 9.0 * (one.com_x - one.zmp_x))

    inner = slice(5, -5)
    change = (plant(c) - plant(clean))[inner]
    # the columns of a scale of x hold where x'' - w2 x = -w2 p; random channels do not obey that, so its left side is taken
    scaled = (clean.com_x_ddot - 9.0 * clean.com_x)[inner]
    expected = amount[0] * (scaled if name == "com_bias" else effect.columns(c)[inner, 0])
    # channels are moved along straight lines between frames: half a frame of their bend is left
    np.testing.assert_allclose(change, expected, atol=0.06 * np.abs(expected).max())


def test_a_filter_and_soft_tissue_are_undone_in_channels() -> None:
    """A Butterworth filter of 3 Hz and a wobble of 4 Hz: what they did to a motion below 1 Hz falls to a twentieth, and to a third; runs
    beside a gap are undone each by itself.
    """
    rate, w2 = 200.0, 9.0
    t = np.arange(0, 12, 1 / rate)
    waves = [(0.03, 2 * np.pi * 0.35, 0.0), (0.01, 2 * np.pi * 0.9, 1.0)]
    x = np.sum([size * np.sin(w * t + phase) for size, w, phase in waves], axis=0)
    pull = -np.sum([size * w**2 * np.sin(w * t + phase) for size, w, phase in waves], axis=0)
    p = x - pull / w2
    late = np.asarray(lfilter(*butter(2, 3.0, fs=rate), p))
    late[1000:1010] = np.nan
    made = Channels({"zmp_x": late, "time": t}, rate, 70.0, 1.0, w2)
    assert PLANT["filter"].undo is not None
    back = PLANT["filter"].undo(made, np.array([np.sqrt(2) / (2 * np.pi * 3.0)])).zmp_x
    inner = np.isfinite(back) & (t > 1) & (t < 11)
    assert np.isfinite(back).sum() == np.isfinite(late).sum()
    assert np.std((back - p)[inner]) < np.std((late - p)[inner]) / 20
    w = 2 * np.pi * 4.0
    soft = np.asarray(lfilter(*bilinear([0.4 * w, w**2], [1.0, 0.4 * w, w**2], fs=rate), x))
    assert PLANT["soft_tissue"].undo is not None
    recorded = Channels({"com_x": soft, "grf_x": 70.0 * pull, "time": t}, rate, 70.0, 1.0, w2)
    bone = PLANT["soft_tissue"].undo(recorded, np.array([4.0])).com_x
    assert np.std((bone - x)[t > 1]) < np.std((soft - x)[t > 1]) / 3


def test_own_effect_is_a_full_member_at_once(tmp_path: Path) -> None:
    """A file in the study's effects/ is in the catalogue under its name, beside all of the library's."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "harness.py").write_text(OWN, encoding="utf-8")
    known = catalogue(tmp_path)
    assert known["harness"].title == "Drag of a harness line"
    assert set(known) - {"harness"} == set(catalogue())
    assert known.broken == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import numpy as np\nx = 1 +\n", "line 2: SyntaxError"),
        ("a = 1\nb = 2\nnonsense\n", "line 3: NameError"),
        ("x = 1\n", "defines no EFFECT"),
        (OWN.replace('needs=("com_x",)', 'needs=("com_x")'), "needs and confounded are tuples"),
        (OWN.replace('ledger="plant"', 'ledger="plants"'), "ledger 'plants'"),
    ],
)
def test_broken_file_is_named_with_its_line_and_the_others_go_on(tmp_path: Path, text: str, said: str) -> None:
    """An effect file with an error is listed with file, line and reason; another file beside it is used."""
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "bad.py").write_text(text, encoding="utf-8")
    (tmp_path / "effects" / "harness.py").write_text(OWN, encoding="utf-8")
    known = catalogue(tmp_path)
    assert "harness" in known
    ((file, error),) = known.broken
    assert file == "effects/bad.py"
    assert said in error


def test_impossible_values_are_refused_in_words() -> None:
    """A value outside its bounds, or far from what physics fixes, is refused with both numbers."""
    assert "not possible" in Parameter("height", "m", -0.06, 0.06).refusal(0.1)
    assert "physics says -1" in Parameter("beta", "1", -2.0, 0.0, physics=-1.0, within=0.35).refusal(-0.3)
    assert Parameter("q", "1").refusal(3.0) == ""


def test_channels_of_both_axes_have_the_same_sense_of_rotation() -> None:
    """L is positive turning +z towards the axis judged: L_y for the lateral axis, -L_x for the forward one."""
    n = 20
    frames = pd.DataFrame({"time": 5.0 + np.arange(n) / 10})
    for k, name in enumerate(["com_x", "com_y", "com_z", "zmp_x", "zmp_y", "zmp_z", "ang_mom_x", "ang_mom_y", "ang_mom_z"]):
        frames[name] = float(k)
    person = Person(1.0, {"lateral": 0.0, "forward": 0.0})
    lateral, forward = (of_trial(frames, axis, 70.0, person) for axis in ("lateral", "forward"))
    assert (lateral.com_x[0], forward.com_x[0]) == (0.0, 1.0)
    assert (lateral.ang_mom[0], forward.ang_mom[0]) == (7.0, -6.0)
    assert lateral.com_z[0] == 2.0 - 5.0
    assert lateral.time[0] == 0.0
    with pytest.raises(AttributeError, match="no channel 'com_w'"):
        _ = lateral.com_w


def test_derivative_stays_within_its_run() -> None:
    """Central differences of a parabola are exact inside a run; a gap stays a gap and spreads to nobody."""
    t = np.arange(30) / 10.0
    y = t**2
    y[12] = np.nan
    d = derivative(y, 10.0, 1)
    np.testing.assert_allclose(d[1:11], 2 * t[1:11], atol=1e-12)
    assert np.isnan(d[12])
    assert np.isfinite(d[[11, 13]]).all()


def test_contract_needs_a_parameter() -> None:
    """An effect without parameters cannot be estimated."""
    with pytest.raises(ValueError, match="at least one Parameter"):
        Effect("t", "plant", "e", "s", ("com_x",), ())
