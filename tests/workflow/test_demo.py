"""The demo study, whole: its recordings, its run, its numbers against the committed reference."""

from pathlib import Path

import pandas as pd
import yaml
from running import REPO, snakemake

from plumbline.papers import compare
from plumbline.simulate import demo


def test_the_demo_gives_the_committed_numbers(tmp_path: Path) -> None:
    """Ladder, omegas and loci of the demo agree with studies/demo/reference within the tolerance of each column."""
    demo.write(tmp_path / "raw")
    done = snakemake(tmp_path, "results/ladder.parquet")
    assert done.returncode == 0, done.stdout + done.stderr
    folder = REPO / "studies" / "demo" / "reference"
    about = yaml.safe_load((folder / "reference.yaml").read_text())
    for name, table in about["tables"].items():
        for line, fine in compare(folder / f"{name}.csv", tmp_path / "results" / table["file"], table):
            assert fine, f"{name}: {line}"


def test_the_demo_shows_every_kind_of_start_and_end() -> None:
    """Somebody recovers, somebody comes back from beyond the stance, somebody falls; to both sides."""
    table = pd.read_csv(REPO / "studies" / "demo" / "reference" / "loci.csv")
    assert {"recovering", "recovering_from_beyond", "falling"} <= set(table["kind"])
    assert set(table["side"]) == {"left", "right"}
