"""Simulate the subject: raw/ and, beside it, truth/."""

from pathlib import Path

from plumbline.simulate.gonzalez import write

write(Path(__file__).resolve().parent)
