"""The first screen says what is missing in words that claim no more than the verdict does."""

from typing import Any

import made_report
import made_tables
import numpy as np
import pandas as pd
import pytest

from plumbline.effects import catalogue
from plumbline.effects_text import separated
from plumbline.report import linked, methods, verdicts, views
from plumbline.report.missing import Ledger, ledger, rate, scaled

Block = dict[str, Any]
EFFECTS = catalogue()
MEANT = {"value": -1.05, "unit": "1", "ci95": [-1.08, -1.02]}


def entry(effect: str | None = "ang_mom", **more: Any) -> Block:
    given = {"effect": effect, "family": [effect], "in_model": False, "error_before_mm": 3.86, "error_after_mm": 0.23, "q_value": 1e-6}
    return given | {"parameters": {"beta": MEANT} if effect == "ang_mom" else {}} | more


def block(missing: list[Block] | None, **more: Any) -> Block:
    errors = {"base_error_mm": 3.86, "model_error_mm": 3.86, "final_error_mm": 0.23, "noise_floor_mm": 0.2}
    return errors | {"missing": missing, "unexplained": False, "description": "", "reason": "r"} | more


def said(one: Ledger) -> str:
    return " ".join([one.head, one.text, *(w for i in one.items for w in (i.head, *i.lines)), *one.apart, *one.commands, *one.refused])


def test_one_effect() -> None:
    """Name, error before and after, size with interval and what physics says, how sure, and what to type."""
    one = ledger(block([entry()]), EFFECTS, auto=False)
    words = said(one)
    assert one.head == "Missing: Angular momentum about the CoM (ang_mom)"
    assert "the error falls to 0.230 mm" in words
    assert "beta = \u22121.05 (95 % interval \u22121.08 to \u22121.02); physics says \u22121." in words
    assert "q < 0.001" in words
    assert one.commands == ["plumbline add ang_mom"]


@pytest.mark.parametrize(("in_model", "auto", "words"), [(True, True, "added by itself"), (True, False, "The configured model has it")])
def test_nothing_to_type(in_model: bool, auto: bool, words: str) -> None:
    """What a model has already is not offered again."""
    one = ledger(block([entry(in_model=in_model)]), EFFECTS, auto)
    assert words in said(one)
    assert not one.commands


def test_families_are_named_together() -> None:
    """A member of a family is named beside the others; where only the family can be told no single name is given, and none to add."""
    apart = "offset or com_bias: an empty plate"
    named = ledger(block([entry("offset", family=["offset", "com_bias"])], separate=[apart]), EFFECTS, auto=False)
    assert "cannot tell it from" in said(named)
    assert apart in said(named)
    unnamed = ledger(block([entry(None, family=["offset", "com_bias"])]), EFFECTS, auto=False)
    assert unnamed.head == "Missing: offset or com_bias"
    assert "cannot tell which of them it is" in said(unnamed)
    assert not unnamed.commands


def test_what_to_record_is_taken_from_the_catalogue() -> None:
    """What tells a family apart is what the catalogue says of its members."""
    said = separated(["offset", "com_bias"], EFFECTS)
    assert said.startswith("offset or com_bias: ")
    assert EFFECTS["offset"].separated in said
    assert EFFECTS["com_bias"].separated in said


def test_several_effects() -> None:
    """With two effects each says what the error would be without it."""
    one = ledger(block([entry(), entry("sync", error_before_mm=1.2)]), EFFECTS, auto=False)
    assert "without this one it would be 1.20 mm" in said(one)
    assert one.commands == ["plumbline add ang_mom", "plumbline add sync"]


def test_nothing_missing_is_said_only_where_it_is_claimed() -> None:
    """An empty list is a claim where the floor is known, weaker where it is not; null and unexplained claim nothing of the kind."""
    assert ledger(block([]), EFFECTS, auto=True).head == "Nothing is missing"
    doubtful = ledger(block([], noise_floor_mm=None), EFFECTS, auto=True)
    assert doubtful.head == "Nothing was found to be missing"
    assert "may be hidden" in doubtful.text
    for other in (block(None), block([], unexplained=True), block([entry()])):
        assert "Nothing is missing" not in said(ledger(other, EFFECTS, auto=True))


def test_unexplained() -> None:
    """What no listed effect explains is described, beside what was found, and never named."""
    where = "in the ZMP against the shear force, 3.2 times noise; no listed effect explains it"
    one = ledger(block([], unexplained=True, description=where), EFFECTS, auto=True)
    assert one.head == "Something is missing that no listed effect explains"
    assert one.text == "It shows in the ZMP against the shear force, 3.2 times noise."
    both = ledger(block([entry()], unexplained=True, description=where), EFFECTS, auto=True)
    assert "ang_mom" in both.head
    assert "something that no listed effect explains" in both.head


def test_not_judged() -> None:
    """Null is not judged, and is said not to mean that nothing is missing."""
    one = ledger(block(None, reason="too few trials"), EFFECTS, auto=True)
    assert (one.tone, one.head) == ("unjudged", "Not judged")
    assert "does not mean that nothing is" in one.text


def test_impostors_and_what_cannot_be_judged() -> None:
    """A refused impostor stands with its error and reason; an effect without channels with what it needs."""
    refused = [
        {"effects": ["gain", "crosstalk"], "error_mm": 0.5, "reason": "height = 0.1 m"},
        {"effects": ["hand"], "error_mm": None, "reason": "x"},
    ]
    one = ledger(block([], refused=refused, cannot_judge={"push": "needs the shear"}), EFFECTS, auto=True)
    assert one.refused[0] == "gain with crosstalk would bring the error to 0.500 mm. Refused: height = 0.1 m."
    assert one.refused[1] == "hand would lower the error. Refused: x."
    assert one.cannot == [("push", "needs the shear")]
    assert "1 effect could not be judged" in one.text


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0162, "s", "16.2 ms"), (-0.004, "m", "\u22124.00 mm"), (1.2, "m", "1.20 m"), (2e-4, "m/s", "0.200 mm/s"),
        (300.0, "N/m", "300 N/m"), (-1.05, "1", "\u22121.05"),
    ],
)  # fmt: skip
def test_units(value: float, unit: str, text: str) -> None:
    """Small lengths, times and speeds are shown in mm and ms; pure numbers have no unit."""
    shown, _, name = scaled(value, unit)
    assert shown + name == text


def test_rates() -> None:
    """A very small q is said to be below a thousandth."""
    assert (rate(1e-9), rate(0.034)) == ("< 0.001", "= 0.034")


# -- tables -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return made_report.criticised(made_tables.study(subjects=2, trials=3))


def test_every_candidate_stands_in_the_table(found: dict[str, Any]) -> None:
    """Every effect of both axes with what became of it, lateral first, what is missing on top."""
    sheet = verdicts.candidates(found["candidates"], EFFECTS)
    assert len(sheet.rows) == len(found["candidates"])
    assert list(sheet.rows[0][:3]) == ["lateral", "ang_mom: Angular momentum about the CoM", "missing"]
    assert ["lateral", "rail", "cannot be judged"] in [list(r[:3]) for r in sheet.rows]
    assert "3.00 to 4.00" in sheet.rows[0]


def test_odd_numbers_of_candidates(found: dict[str, Any]) -> None:
    """Endless numbers of trials and inflations are cut off in words; what is not known is a dash."""
    table = found["candidates"].iloc[:1].assign(trials_80=np.inf, vif=1e9, q=np.nan)
    assert list(verdicts.candidates(table, EFFECTS).rows[0][6:9]) == ["\u2013", "> 100", "> 1000"]
    assert verdicts.candidates(None, EFFECTS).empty


def test_laws() -> None:
    """Every law has its errors over loci and its lead over the paper's law on the same ones; what was not refused stands on top."""
    one = {"subject": "a", "task": "lateral", "condition": "", "trial": "1", "loci": 3}
    one |= {"mode": "loop", "reason": "", "frames": 100, "refused": False}
    rows = [
        {**one, "candidate": "", "square_sum": 4e-4, "zmp_square_sum": 9e-4, "score": 90.0},
        {**one, "candidate": "", "square_sum": 4e-4, "zmp_square_sum": 9e-4, "score": 90.0, "trial": "2"},
        {**one, "candidate": "delay", "square_sum": 1e-4, "zmp_square_sum": 4e-4, "score": 50.0},
        {**one, "candidate": "delay+lag", "square_sum": 1e-4, "zmp_square_sum": 4e-4, "score": 51.0, "refused": True},
    ]
    sheet = verdicts.laws(pd.DataFrame(rows), {})
    assert [list(r) for r in sheet.rows] == [
        ["delay", "3", "1.00", "2.00", "40.0", "\u2013"],
        ["none", "6", "2.00", "3.00", "0.0", "\u2013"],
        ["delay, lag", "3", "1.00", "2.00", "39.0", "too small, or at a bound"],
    ]
    assert not verdicts.laws(None, {}).rows


def test_subject_by_subject(found: dict[str, Any]) -> None:
    """With several subjects each has a row; with one there is no such table."""
    sheet = verdicts.subjects(found["verdict"])
    assert [r[0] for r in sheet.rows] == ["sub-01", "sub-02"]
    assert [r[4] for r in sheet.rows] == ["ang_mom", "ang_mom"]
    assert not verdicts.subjects({"by_subject": {"sub-01": {}}}).rows


# -- what rungs and effects add ---------------------------------------------------------------------------------------


def test_contributions_join_the_samples(found: dict[str, Any]) -> None:
    """At a window's frame a sample has that window's value; between windows a straight line; far from any nothing."""
    points = pd.DataFrame({"trial": "a", "frame": [0, 5, 7, 10, 60, 100]})
    windows = pd.DataFrame({"trial": "a", "frame": [0, 5, 10, 95, 100], "after m": [0.0, 1.0, 2.0, 3.0, 4.0], "before": 1.0})
    out = linked.added(points, windows)
    assert list(out) == ["after m"]
    np.testing.assert_allclose(out["after m"], [0.0, 1.0, 1.4, 2.0, np.nan, 4.0])


def test_views_of_rungs_and_effects(found: dict[str, Any]) -> None:
    """Each rung and each effect has a panel; the phase plane can be coloured by the error of each rung."""
    view = linked.linked(found["residuals"], found["where"], 0.4, found["contributions"], EFFECTS)
    assert view.errors["lateral"] == [("error", "the paper's equation"), ("after0", "+ ang_mom")]
    for words in ("Error that is left with ang_mom", "Angular momentum about the CoM (ang_mom)", "Trial by trial"):
        assert words in view.documents


def test_panels_are_bounded() -> None:
    """At most so many panels of rungs and of effects, however many there are."""
    more = {f"{kind} {k}": np.zeros(2) for kind in ("after", "effect") for k in range(30)}
    assert len(views.columns(more)) == 2 * views.MOST


def test_effects_that_add_most_come_first() -> None:
    """Rungs stand as they were climbed, effects by what they add."""
    more = {"effect a": np.array([1.0, np.nan]), "after z": np.ones(2), "effect b": np.array([2.0, -2.0]), "after m": np.ones(2)}
    assert list(views.columns(more).values()) == ["after z", "after m", "effect b", "effect a"]


def test_methods_say_what_was_searched(found: dict[str, Any]) -> None:
    """The paragraph to paste says how effects were searched for and what was found, in numbers; without a search it does not."""
    words = " ".join(methods.paragraphs(found, found["verdict"], made_tables.CONFIG))
    assert "searched for among 4 listed effects" in words
    assert "Found to be missing: ang_mom (beta = \u22121.05 (95 % interval \u22121.08 to \u22121.02), error with it" in words
    assert "No listed effect was found to be missing" in words  # forward
    assert any("Benjamini" in r for r in methods.references(found))
    plain = made_tables.study(trials=3)
    assert "searched for" not in " ".join(methods.paragraphs(plain, plain["verdict"], made_tables.CONFIG))


# -- the page ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("clean", "Nothing is missing"), ("found", "Missing: Angular momentum"), ("family", "Missing: offset or com_bias"),
        ("unexplained", "no listed effect explains"), ("unjudged", "Not judged"),
    ],
)  # fmt: skip
def test_pages(kind: str, words: str) -> None:
    """The page of each kind of verdict says it within its first section, and holds no bare nan or None."""
    html = made_report.page(made_report.criticised(made_tables.study(trials=3), kind))
    first = html[html.index('id="result"') : html.index('id="candidates"')]
    assert words in first
    assert not any(bare in first for bare in ("nan", "None"))


def test_page_without_the_new_tables() -> None:
    """Results without candidates and contributions still make a page."""
    made = made_tables.study(trials=3)
    assert "No effect was judged." in made_report.page({k: v for k, v in made.items() if k not in ("candidates", "contributions")})


def test_same_bytes(found: dict[str, Any]) -> None:
    """The same results give the same bytes."""
    assert made_report.page(found) == made_report.page(found)
