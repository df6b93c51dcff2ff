"""Which effects are missing: on the disclosed studies, and on sums whose truth is known."""

from pathlib import Path

import numpy as np
import pytest
from made_study import EVALUATION, Result

from plumbline.criticism import settled
from plumbline.effects import catalogue
from plumbline.evidence import Weak
from plumbline.found import Finding
from plumbline.search import design, fit, heldout, subsets, sums


def lateral(folder: Path, drop: tuple[str, ...] = ()) -> tuple[list[Weak], Finding]:
    """Windows of a study, some channels deleted, the instruments settled; and what they say."""
    got = Result(folder)
    signals = got.signals.copy()
    for name in drop:
        signals[name] = np.nan
    windows, finding = settled(signals, got.pushes, got.coverage, catalogue(), EVALUATION, "lateral")
    assert finding is not None
    return windows, finding


TRUTH = {
    "clean": {},
    "ang_mom": {"ang_mom": (-1.0, 0.1)},
    "height": {"height": (1.0, 0.15)},
    "sync": {"sync": (0.016, 0.001)},
    "delay": {},
}


@pytest.mark.parametrize(("name", "truth"), TRUTH.items())
def test_disclosed_studies_name_what_is_hidden_and_nothing_else(shared_data: Path, name: str, truth: dict) -> None:
    """The hidden plant effect is named with its size; clean data and a neural delay accuse nobody; the error falls to the floor."""
    _, got = lateral(shared_data / "hidden_effect" / name)
    assert {f.effect for f in got.found} == set(truth)
    assert got.shapes == ()
    for one in got.found:
        value, within = truth[one.effect]
        assert next(iter(one.parameters.values()))[0] == pytest.approx(value, abs=within)
        assert one.before > 2 * one.after
    assert got.final < 1.4 * got.floor


def test_without_segments_angular_momentum_is_not_named(shared_data: Path) -> None:
    """The effect that is there cannot be judged without its channel, and is listed with what it needs."""
    _, got = lateral(shared_data / "hidden_effect" / "ang_mom", ("ang_mom_x", "ang_mom_y", "ang_mom_z"))
    assert "ang_mom" in got.lacking
    assert "ang_mom" not in {f.effect for f in got.found}
    assert got.final > 2 * got.floor


def test_without_shear_there_is_only_the_whole_equation(shared_data: Path) -> None:
    """Without shear a hand cannot be judged, and angular momentum still is."""
    windows, got = lateral(shared_data / "hidden_effect" / "ang_mom", ("grf_x", "grf_y"))
    assert sums(windows, ["ang_mom"], 9.8).equations == ("whole",)
    assert "hand" in got.lacking
    assert {f.effect for f in got.found} == {"ang_mom"}


def made(rng: np.random.Generator, trials: int = 8, *, gain: float = 0.0) -> list[Weak]:
    """Windows whose every relation is exact but for noise: x - p = h F/m - q p."""
    from plumbline.weak import Bump

    out = []
    for k in range(trials):
        n = 60
        force, p = rng.normal(0, 0.3, n), rng.normal(0, 0.03, n)
        lever = 0.1 * force - gain * p + rng.normal(0, 1e-4, n)
        terms = {}
        for name, part in (("gain", p), ("drift", np.arange(n) * 0.1)):
            zero = np.zeros((n, 1))
            terms[name] = {"plain": zero, "by_w2": part[:, None], "force": zero, "vertical": zero}
        noise = dict.fromkeys(("x", "p", "z", "fx", "fz"), 1e-4)
        bump = Bump(0.4, 4, 100.0)
        kinematic = force + rng.normal(0, 1e-3, n)
        out.append(
            Weak(
                f"t{k}", "s", "lateral", "", "lateral", np.arange(n), np.arange(n) * 0.1, np.arange(n) // 20, p + lever, p, p,
                kinematic, force, np.zeros(n), 70.0, 1.0, noise, bump, terms, {},
            )
        )  # fmt: skip
    return out


def test_held_out_errors_are_those_of_fits_without_the_trial() -> None:
    """Errors from sums of products are those of explicit least squares without the trial's fold, window by window."""
    windows = made(np.random.default_rng(1), gain=0.1)
    s = sums(windows, ["gain", "drift"], 10.0)
    weight = np.array([1.0, 50.0, 0.0, 0.0])
    columns = s.of(["gain"])
    got = heldout(s, weight, [columns])[0]
    left = 3
    x, y, c = [], [], []
    for k, w in enumerate(windows):
        for e, factor in (("kinematic", 1.0), ("moment", 50.0)):
            a, b = design(w, e, ["gain", "drift"], 10.0, 0.1)
            if k != left:
                x.append(np.sqrt(factor) * a[:, columns])
                y.append(np.sqrt(factor) * b)
            elif e == "moment":
                c = [a[:, columns], b]
    use = [0, 1, 3, 4]  # the vertical constant stands in neither equation
    theta, *_ = np.linalg.lstsq(np.concatenate(x)[:, use], np.concatenate(y), rcond=None)
    error = float(np.sum((c[1] - c[0][:, use] @ theta) ** 2))
    assert got[1, s.trial == left].sum() == pytest.approx(error, rel=1e-6)


def test_intervals_cover_the_truth() -> None:
    """The 95 % interval of a coefficient covers the truth in 90 to 99 of 100 studies."""
    rng = np.random.default_rng(2)
    inside = 0
    for _ in range(100):
        s = sums(made(rng, gain=0.05), ["gain"], 10.0)
        f = fit(s, np.array([1e6, 1e8, 0.0, 0.0]), s.of(["gain"]))
        theta, covariance = f.of(s, "gain")
        inside += abs(theta[0] - 0.05) < 2.365 * np.sqrt(covariance[0, 0])
    assert 88 <= inside <= 99


def test_sets_hold_no_two_that_look_the_same() -> None:
    """Twins are never offered together; every other pair is."""
    got = subsets(("a", "b", "c"), 2, {"a": {"b"}})
    assert got == [(), ("a",), ("b",), ("c",), ("a", "c"), ("b", "c")]
