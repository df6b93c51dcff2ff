"""What no effect explains: whether anything is left in a residual, and what it looks like."""

import subprocess
import sys

import numpy as np
import pytest
from made_hidden import Hidden, study

from plumbline.evidence import Weak
from plumbline.formulas import Formula, formulas, projected, remains
from plumbline.library import Library
from plumbline.structure import Structure, structure
from plumbline.weak import Bump

SETTLED = ("sync", "com_bias")  # what a search always fits
EQUATIONS = ("kinematic", "moment")


def asked(h: Hidden, equation: str) -> tuple[Structure, list[Formula], list[np.ndarray]]:
    """Structure and formulas of an equation's residual, and what was fitted."""
    left, beside = remains(h.windows, SETTLED, h.w2, equation)
    floor = float(np.sqrt(np.mean([w.floor(equation, 1 / h.w2) for w in h.windows])))
    found = structure(h.windows, h.terms, left, equation, floor, beside)
    return found, formulas(h.windows, h.terms, left, equation, beside) if found.left else [], beside


HIDDEN = {
    "wall": ("kinematic", 1), "cubic": ("kinematic", 1), "friction": ("kinematic", 3),
    "periodic": ("kinematic", 1), "bent_cop": ("moment", 2), "creep": ("moment", 1),
}  # fmt: skip


@pytest.mark.parametrize(("name", "where"), HIDDEN.items())
def test_the_best_formula_is_the_hidden_term(name: str, where: tuple[str, int]) -> None:
    """A hidden term that stands in no catalogue is seen, and the best formula follows its true residual, sign and all, beyond 0.9."""
    equation, seed = where
    h = study(name, seed)
    found, told, beside = asked(h, equation)
    truth, values = np.concatenate(h.truth[equation]), np.concatenate(told[0].values)
    p = projected(np.column_stack([truth, values]), h.windows, beside)
    assert found.left
    assert np.corrcoef(truth, values)[0, 1] > 0.9
    assert np.corrcoef(p.T)[0, 1] > 0.9
    assert told[0].share > 0.5
    assert f"[{'m' if equation == 'moment' else 'm/s2'}]" in told[0].text
    assert told[0].text.endswith("no known effect")
    assert not any(set(other.names) >= set(told[0].names) for other in told[1:])


@pytest.mark.parametrize("seed", [11, 12])
def test_nothing_is_left_in_a_clean_study(seed: int) -> None:
    """Bodies that are a little softer than the model and markers with noise leave nothing worth a word."""
    h = study("", seed)
    for equation in EQUATIONS:
        found, *_ = asked(h, equation)
        assert not found.left
        assert "nothing" in found.text


# -- residuals of which everything is known ---------------------------------------------------------------------------

BUMP = Bump(0.4, 4, 100.0)
STEP = 5  # frames between windows
NAMES = ("x", "v", "p", "com_y", "t")


def made(rng: np.random.Generator, trials: int = 8, seconds: float = 10.0) -> tuple[list[Weak], Library, list[np.ndarray]]:
    """Windows of trials with slow random channels, and bump means of white noise of size one."""
    n = int(seconds * 100)
    windows, values, noise = [], [], []
    for k in range(trials):
        picked = np.arange(BUMP.reach, n - BUMP.reach, STEP)
        slow = np.cumsum(rng.normal(0, 1, (n, len(NAMES))), axis=0) - 0.0
        slow[:, -1] = np.arange(n) / 100.0
        values.append(BUMP.mean(slow)[picked])
        noise.append(BUMP.mean(rng.normal(0, 1 / np.sqrt(BUMP.value @ BUMP.value), n))[picked])
        zero = np.zeros(len(picked))
        windows.append(
            Weak(
                f"t{k}", "s", "lateral", "", "lateral", picked, picked / 100.0, picked // 500, zero, zero, zero, zero, zero, zero,
                70.0, 1.0, {}, BUMP, {}, {},
            )
        )  # fmt: skip
    return windows, Library(NAMES, NAMES, tuple(values)), noise


def test_noise_alone_follows_nothing() -> None:
    """The least p-value of white noise is below 0.05 for each of channels, trials and memory in no more than one study of ten."""
    least = []
    for seed in range(60):
        windows, terms, noise = made(np.random.default_rng(seed))
        found = structure(windows, terms, noise, "kinematic", 1.0)
        assert not found.left
        least.append([min(v for k, v in found.p.items() if k in NAMES), found.p["trial"], found.p["itself"]])
    assert np.all(np.mean(np.array(least) < 0.05, axis=0) <= 0.1)


def test_noise_alone_has_no_formula() -> None:
    """White noise has no formula, although the fastest rhythm and the best edge are looked for."""
    for seed in range(8):
        windows, terms, noise = made(np.random.default_rng(seed))
        assert formulas(windows, terms, noise, "kinematic") == []


def test_what_a_residual_follows_is_said() -> None:
    """A residual with a share of the velocity, a step between trials, or a rhythm of its own says so."""
    windows, terms, noise = made(np.random.default_rng(5))
    v = [a[:, 1] / np.std(np.concatenate(terms.values)[:, 1]) for a in terms.values]
    pairs = {
        "follows the velocity, r = -0.": [a - b for a, b in zip(noise, v, strict=True)],
        "differs between trials": [a + 2.0 * (-1) ** k for k, a in enumerate(noise)],
        "its own past": [a + 2.0 * np.sin(2 * np.pi * 1.25 * w.time + k) for k, (a, w) in enumerate(zip(noise, windows, strict=True))],
    }
    for words, residual in pairs.items():
        found = structure(windows, terms, residual, "kinematic", 1.0)
        assert found.left
        assert words in found.text


def test_a_formula_is_not_spoilt_by_what_was_fitted_before() -> None:
    """A residual from which a column like the term was taken keeps the term's coefficient; it would lose most of it otherwise."""
    windows, terms, noise = made(np.random.default_rng(6))
    x = [a[:, 0] for a in terms.values]
    fitted = [(a + 0.5 * np.std(np.concatenate(x)) * e)[:, None] for a, e in zip(x, made(np.random.default_rng(7))[2], strict=True)]
    y = projected(np.concatenate([3.0 * a + 0.1 * e for a, e in zip(x, noise, strict=True)])[:, None], windows, fitted)[:, 0]
    left = np.split(y, np.cumsum([len(a) for a in x])[:-1])
    best = formulas(windows, terms, left, "kinematic", fitted)[0]
    assert best.names == ("x",)
    assert best.coefficients[0] == pytest.approx(3.0, rel=0.02)
    assert best.kept == (1.0,)
    assert formulas(windows, terms, left, "kinematic")[0].coefficients[0] < 2.0


@pytest.mark.parametrize("trials", [1, 2])
def test_few_trials_are_judged_by_their_pieces(trials: int) -> None:
    """With too few trials to leave one out, stretches of them are left out; a noise that is not known decides nothing."""
    windows, terms, noise = made(np.random.default_rng(9), trials, seconds=30.0)
    left = [a - 0.1 * b[:, 1] for a, b in zip(noise, terms.values, strict=True)]
    assert structure(windows, terms, left, "kinematic", 1.0).left
    assert formulas(windows, terms, left, "kinematic")[0].names == ("v",)
    assert not structure(windows, terms, left, "kinematic", float("nan")).left


def test_x_alone_explains_no_moment() -> None:
    """Where p is fitted, x - p is x: neither is offered in an equation that holds both."""
    windows, terms, _ = made(np.random.default_rng(8))
    x, p = ([a[:, k] for a in terms.values] for k in (0, 2))
    left = [a - b for a, b in zip(x, p, strict=True)]
    told = formulas(windows, terms, left, "moment", [b[:, None] for b in p])
    assert all("x" not in one.names for one in told)


def test_sparse_regression_is_loaded_only_where_it_is_used() -> None:
    """Reading the module does not read PySINDy, which takes two seconds."""
    code = "import sys, plumbline.formulas, plumbline.structure; sys.exit('pysindy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
    import pysindy

    assert pysindy.__version__ >= "2.1"
