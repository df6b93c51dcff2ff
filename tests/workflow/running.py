"""Run Snakemake on a study as a user would."""

import os
import subprocess
import sys
from pathlib import Path

REPO = Path(__file__).resolve().parents[2]
SNAKEMAKE = Path(sys.executable).with_name("snakemake")
ENVIRONMENT = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}


def snakemake(study: Path, *options: str, repo: Path = REPO, cores: int = 2) -> subprocess.CompletedProcess[str]:
    command = [str(SNAKEMAKE), "-s", str(repo / "Snakefile"), "-d", str(study), f"-c{cores}", *options]
    return subprocess.run(command, capture_output=True, text=True, env=ENVIRONMENT, timeout=300)
