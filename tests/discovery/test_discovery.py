"""The cohort that judges the search: studies in memory are those of the files, verdicts are scored as they should be."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from made_study import Result

from benchmarks import _score, discovery
from benchmarks._study import Stages
from plumbline.simulate import cohort
from plumbline.simulate.study import write_study

SMALL = {"people": 1, "trials": 3, "duration": 5.0, "rate": 100.0, "force_rate": 500.0}


def test_a_study_in_memory_is_the_one_of_its_files(tmp_path: Path) -> None:
    """Signals, loci and held-out errors are those of the same study written as C3D files and read again, to single precision."""
    case = cohort.draw(12, "one", names=("offset",), **SMALL)
    write_study(
        tmp_path, case.subjects, trials=case.trials, duration=case.duration, seed=case.seed, rate=case.rate, force_rate=case.force_rate,
        effects=case.effects, controller=case.controllers, habits=case.habits, marker_noise=case.marker_noise,
        force_noise=case.force_noise,
    )  # fmt: skip
    files, tables = Result(tmp_path), Stages(case).plant()
    for name in ("signals", "loci", "pushes", "heldout"):
        mine, theirs = tables[name], getattr(files, name)
        numbers = mine.select_dtypes("number").columns
        np.testing.assert_allclose(mine[numbers], theirs[numbers], rtol=2e-4, atol=2e-5, err_msg=name)
        assert list(mine["trial"]) == list(theirs["trial"])


def _block(base: float = 3.0, missing: list[dict[str, Any]] | None = None, unexplained: bool = False) -> dict[str, Any]:
    return {"base_error_mm": base, "noise_floor_mm": 1.0, "missing": missing or [], "unexplained": unexplained}


def _entry(effect: str, *family: str, **parameters: float) -> dict[str, Any]:
    values = {k: {"value": v} for k, v in parameters.items()}
    return {"effect": effect, "family": [effect, *family], "parameters": values}


def _line(kind: str, effects: dict[str, Any], plant: Any = None, control: Any = None, **more: Any) -> dict[str, Any]:
    truth = {
        "effects": effects, "plant": sorted(set(effects) - set(cohort.CONTROL)), "control": sorted(set(effects) & set(cohort.CONTROL)),
        "inside": not set(effects) & set(cohort.BEYOND),
    }  # fmt: skip
    verdict = {"plant": plant or _block(1.0), "control": control or _block(1.0)}
    return {"kind": kind, "number": 0, "truth": truth, "verdict": verdict, "alone": {}, "spent": {}, "error": "", **more}


def test_wilson_interval_is_the_published_one() -> None:
    """For 0 of 300 and 81 of 263 (Newcombe 1998, table I) the interval is the printed one; nothing counted says nothing."""
    assert _score.wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert _score.wilson(0, 20) == pytest.approx((0.0, 0.1611), abs=1e-4)
    assert _score.wilson(0, 0) == (0.0, 1.0)


def test_a_name_is_right_in_its_family_and_ledger_only() -> None:
    """The true effect counts as found through its family; in the other ledger, or beside another name, the study is wrong."""
    truth = {"sync": {"delay": 0.01}}
    through = _line("one", truth, _block(missing=[_entry("filter", "sync")]))
    assert _score.right(through)
    assert _score.found(through, "sync")
    elsewhere = _line("one", truth, control=_block(missing=[_entry("sync")]))
    assert not _score.found(elsewhere, "sync")
    assert _score.accused(elsewhere)
    besides = _line("one", truth, _block(missing=[_entry("sync"), _entry("gain")]))
    assert _score.found(besides, "sync")
    assert _score.wrong(besides, "plant") == ["gain"]
    assert not _score.right(besides)
    assert not _score.right(_line("one", truth, _block(missing=[_entry("sync")], unexplained=True)))
    assert not _score.right(_line("one", truth, {**_block(), "missing": None}))


def test_an_effect_is_visible_from_twice_the_floor() -> None:
    """Its size is the base error of its own ledger in floors, or that of the study with it alone where two share a ledger."""
    line = _line("one", {"delay": {}}, _block(9.0), _block(1.9))
    assert _score.size(line, "delay") == 1.9
    assert not _score.visible(line)
    pair = _line("two", {"gain": {}, "drift": {}}, _block(9.0), alone={"gain": [1.5, 1.0], "drift": [8.0, 1.0]})
    assert not _score.visible(pair)


def test_rates_count_what_they_say() -> None:
    """Each row of the table of rates holds the studies it speaks of."""
    lines = [
        _line("clean", {}),
        _line("clean", {}, _block(1.0, unexplained=True)),
        _line("one", {"gain": {"q": 0.1}}, _block(missing=[_entry("gain", q=0.11)])),
        _line("one", {"drift": {"c": 0.1}}, _block(1.2)),
        _line("outside", {"wall": {}}, _block(unexplained=True)),
        _line("outside", {"cubic": {}}, _block(missing=[_entry("hand")])),
        _line("clean", {}, error="lost"),
    ]
    rows = {row["claim"]: (row["are"], row["of"]) for row in _score.rates(lines, catalogue=20)}
    assert rows["clean studies accused"] == (1, 2)
    assert rows["one effect, >= 2 floors: right family named"] == (1, 1)
    assert rows["outside the catalogue, >= 2 floors: unexplained"] == (1, 2)
    assert rows["outside the catalogue, any size: a wrong name"] == (1, 2)
    assert rows["inside the catalogue: unexplained"] == (1, 4)
    assert rows["no verdict: an error"] == (1, 7)
    gain = next(row for row in _score.of_effects(lines) if row["effect"] == "gain")
    assert gain["size / true"] == pytest.approx(1.1)
    assert [(r["effect"], r["floors"], r["found"]) for r in _score.power(lines)] == [("drift", 1.2, False), ("gain", 3.0, True)]


def _blind(tables: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """A judge that never finds anything."""
    assert {"signals", "coverage", "pushes", "loci", "trust", "clusters", "choice", "controller", "fit", "heldout"} <= set(tables)
    return {"plant": _block(), "control": _block()}


def test_a_broken_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    """Studies whose line stands in the file are not made again; a line cut short is; the plan mixes the kinds."""
    jobs = discovery.plan(1, 1, 0, 0, seed=3)
    assert jobs == [("clean", 0, 3), ("one", 0, 3)]
    file = tmp_path / "lines.jsonl"
    first = discovery.run(jobs[:1], file, 1, judge=_blind, **SMALL)
    file.write_text(file.read_text() + '{"kind": "one", "num\n')
    both = discovery.run(jobs, file, 1, judge=_blind, **SMALL)
    assert both[0] == first[0]
    assert [line["kind"] for line in both] == ["clean", "one"]
    assert not any(line["error"] for line in both)
    assert len([text for text in file.read_text().splitlines() if text.endswith("}")]) == 2
    assert json.loads(file.read_text().splitlines()[-1])["truth"]["plant"] == ["ang_mom"]
    assert discovery.draw(_score.power(both)).axes


def test_a_failing_judge_is_counted_not_hidden() -> None:
    """An error in the judge leaves a line that says so."""

    def broken(tables: Any) -> dict[str, Any]:
        raise RuntimeError("lost")

    line = discovery.study(("clean", 0, 1), broken, **SMALL)
    assert "RuntimeError: lost" in line["error"]
    assert _score.rates([line], 20)[-1]["are"] == 1
