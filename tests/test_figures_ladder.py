"""The ladder's figure: which rung earns its place, groups, colours, and what is not drawn."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.text import Text

from plumbline.figures import _style, ladder

ALL = {"task": "all", "subject": "all", "condition": "all"}


def rungs(errors: list[float], floor: float = 0.4, half: float = 0.1, **more: str) -> list[dict[str, object]]:
    """Rungs with these errors, each interval reaching `half` to both sides."""
    names = ["base", *(f"+ e{k}" for k in range(1, len(errors)))]
    about = {"ledger": "plant", "axis": "lateral", "kind": "weak", **ALL, **more}
    return [
        {**about, "model": name, "effects": ", ".join(n[2:] for n in names[1 : i + 1]), "error_mm": error, "ci_low_mm": error - half,
         "ci_high_mm": error + half, "noise_floor_mm": floor}
        for i, (name, error) in enumerate(zip(names, errors, strict=True))
    ]  # fmt: skip


def texts(figure: Figure) -> str:
    return " ".join(t.get_text() for t in figure.findobj(Text))


@pytest.mark.parametrize(
    ("errors", "floor", "half", "earns"),
    [
        ([4.0, 1.0], 0.4, 0.1, ["", "yes"]),
        ([4.0, 3.95], 0.0, 0.1, ["", "no"]),  # inside the interval of the rung before
        ([4.0, 3.7], 2.0, 0.1, ["", "no"]),  # less than a quarter of the floor
        ([4.0, 3.7], np.nan, 0.1, ["", "yes"]),  # the floor is not known: the interval decides
        ([4.0, 1.0], 0.4, np.nan, ["", ""]),  # too few trials for an interval: nothing is claimed
        ([4.0, 1.0, 1.2], 0.4, 0.1, ["", "yes", "no"]),
    ],
)
def test_rungs_that_earn_their_place(errors: list[float], floor: float, half: float, earns: list[str]) -> None:
    """A rung earns its place below the interval of the rung before it and by a quarter of the floor; without an interval: no word."""
    assert list(ladder.earned(pd.DataFrame(rungs(errors, floor, half)))["earns"]) == earns


def test_groups_are_compared_with_themselves() -> None:
    """A rung is compared with the rung before it of the same axis, group and kind of error."""
    table = pd.DataFrame(rungs([4.0, 1.0]) + rungs([9.0, 8.99], subject="sub-01") + rungs([0.5, 0.1], axis="forward"))
    assert list(ladder.earned(table)["earns"]) == ["", "yes", "", "no", "", "yes"]


def test_hollow_rungs_say_so() -> None:
    """A rung that does not earn its place is hollow and says so; the others are filled; the floor is black."""
    figure = ladder.draw(pd.DataFrame(rungs([4.0, 1.0, 0.99])))
    lines = figure.subfigs[0].axes[0].lines
    marks = [ln for ln in lines if ln.get_marker() == "o"]
    assert [same_color(m.get_markerfacecolor(), "white") for m in marks] == [False, False, True]
    assert all(same_color(m.get_color(), _style.RESIDUAL) for m in marks)
    assert any(same_color(ln.get_color(), _style.MEASURED) for ln in lines)
    assert texts(figure).count("does not earn its place") == 2  # at the rung, and in the key


def test_each_axis_has_rungs_of_its_own() -> None:
    """What was found laterally makes no empty rung forward."""
    figure = ladder.draw(pd.DataFrame(rungs([4.0, 1.0]) + rungs([4.0], axis="forward")))
    lateral, forward = figure.subfigs[0].axes[:2]
    assert [t.get_text() for t in lateral.get_yticklabels()] == ["the paper's equation", "+ e1"]
    assert [t.get_text() for t in forward.get_yticklabels()] == ["the paper's equation"]


def test_controller_has_a_ladder_of_its_own() -> None:
    """The rungs of the controller stand in their own panel; where it was not judged there is none."""
    plant = rungs([4.0])
    assert "controller" not in texts(ladder.draw(pd.DataFrame(plant)))
    said = texts(ladder.draw(pd.DataFrame(plant + rungs([3.0, 1.0], ledger="control", kind="free_run"))))
    assert "controller, lateral" in said
    assert "the paper's law" in said


def test_groups_that_are_left_out_are_counted() -> None:
    """At most twelve small panels; the figure says how many groups more there are, and many subjects share one panel."""
    rows = [r for k in range(20) for r in rungs([4.0, 1.0], condition=f"c{k:02d}")]
    figure = ladder.draw(pd.DataFrame(rungs([4.0, 1.0]) + rows))
    assert sum(a.get_visible() for a in figure.subfigs[-1].axes) == ladder.MOST
    assert "8 more groups are in results/ladder.parquet" in texts(figure)
    many = pd.DataFrame(rungs([4.0, 1.0]) + [r for k in range(50) for r in rungs([4.0, 1.0], subject=f"sub-{k:02d}")])
    assert ladder.grouped(many) == ([("subject", "*")], 0)
    assert "50 subjects" in texts(ladder.draw(many))


def test_models_of_the_config_say_their_effects() -> None:
    """A model with a name of its own has its effects beside the name; one named by its effect has not."""
    table = pd.DataFrame(rungs([4.0, 1.0, 0.5])).assign(model=["base", "e1", "full"])
    labels = [t.get_text() for t in ladder.draw(table).subfigs[0].axes[0].get_yticklabels()]
    assert labels == ["the paper's equation", "e1", "full: e1, e2"]
