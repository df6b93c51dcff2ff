"""Shared fixtures. Public recordings are never part of the repository: tests that need them skip without."""

import os
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of public and made recordings: PLUMBLINE_DATA, else ../shared/data beside the repository."""
    folder = Path(os.environ.get("PLUMBLINE_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings in {folder}: set PLUMBLINE_DATA to the folder of public data to run this test")
    return folder
