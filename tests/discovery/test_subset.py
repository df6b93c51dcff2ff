"""Twenty studies of the cohort, judged by the project's own search: a small `make discovery` of one seed."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks import _score, discovery

SMALL = {"people": 1, "trials": 6, "duration": 10.0, "force_rate": 500.0, "rate": 100.0}
SEED = 20


def test_twenty_studies_are_judged_right(tmp_path: Path) -> None:
    """Of 8 clean studies none is accused; no study has a wrong name; all visible effects but at most one are found."""
    lines = discovery.run(discovery.plan(8, 8, 2, 2, SEED), tmp_path / "lines.jsonl", 2, **SMALL)
    assert len(lines) == 20
    assert [line["error"] for line in lines if line["error"]] == []
    assert [line["number"] for line in lines if line["kind"] == "clean" and _score.accused(line)] == []
    assert [(line["kind"], line["number"]) for line in lines if _score.names(line)] == []
    missed = [
        (line["kind"], line["number"]) for line in lines if line["truth"]["inside"] and _score.visible(line) and not _score.all_found(line)
    ]
    assert len(missed) <= 1, missed
