"""Simulate the subject of the paper: raw/ and, beside it, truth.json."""

from pathlib import Path

from plumbline.simulate.murai import write

write(Path(__file__).resolve().parent)
