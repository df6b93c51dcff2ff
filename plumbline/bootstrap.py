"""Set up the environment and run the pipeline or the tests: what the Makefile calls. Standard library only.

`.venv` is made from the two hash-pinned locks: uv by pip, everything else by uv (pip alone takes six times as long).
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

from plumbline.study import recordings  # standard library only, as this file

REPO = Path(__file__).resolve().parents[1]
VENV = REPO / ".venv"
BIN = VENV / ("Scripts" if os.name == "nt" else "bin")
COMMANDS = ("setup", "run", "test", "check", "papers")
LOCKS = ("requirements-uv.lock", "requirements.lock", "pyproject.toml")
LEAST = (3, 11)
MAKER = "make_raw.py"  # of a simulated study: writes its raw/ where that is empty

#: one BLAS thread per job and no clock: numbers and bytes must not depend on the machine's load
ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "SOURCE_DATE_EPOCH": "0",
    "MPLBACKEND": "agg",
}


def main(arguments: list[str]) -> int:
    """Carry out one of :data:`COMMANDS`; returns the exit code."""
    if sys.version_info < LEAST:
        print(f"plumbline needs Python {LEAST[0]}.{LEAST[1]} or newer, this is {sys.version.split()[0]}", file=sys.stderr)
        return 2
    os.environ.update(ENVIRONMENT)
    command, rest = arguments[0], arguments[1:]
    code = setup()
    if code or command == "setup":
        return code
    return {"run": run, "test": test, "check": check, "papers": papers}[command](rest)


def setup() -> int:
    """Make .venv from the locks unless it is up to date."""
    state = hashlib.sha256(b"".join((REPO / name).read_bytes() for name in LOCKS)).hexdigest()
    stamp = VENV / "plumbline.stamp"
    if stamp.is_file() and stamp.read_text() == state and (BIN / _exe("snakemake")).exists():
        return 0
    print("Setting up .venv (once; about a minute on a slow line)", flush=True)
    python, uv = str(BIN / _exe("python")), str(BIN / _exe("uv"))
    steps = [
        [sys.executable, "-m", "venv", str(VENV)],
        [
            python,
            "-m",
            "pip",
            "install",
            "-q",
            "--disable-pip-version-check",
            "--require-hashes",
            "--no-deps",
            "-r",
            "requirements-uv.lock",
        ],
        [uv, "pip", "install", "-q", "--compile-bytecode", "--python", python, "--require-hashes", "-r", "requirements.lock"],
        [uv, "pip", "install", "-q", "--python", python, "--no-deps", "--no-build-isolation", "-e", "."],
    ]
    for step in steps:
        if code := subprocess.run(step, cwd=REPO).returncode:
            print(f"setup failed at: {' '.join(step)}", file=sys.stderr)
            return code
    stamp.write_text(state)
    return 0


def run(arguments: list[str]) -> int:
    """`run [STUDY] [snakemake options]`: make a simulated study's recordings where needed, run, and zip the Snakemake report."""
    named = bool(arguments) and not arguments[0].startswith("-")
    study = Path(arguments[0]).resolve() if named else REPO
    options = arguments[1:] if named else arguments
    if not study.is_dir():
        print(f"{study}: no such folder; give the study's folder, e.g. make run STUDY=studies/pds", file=sys.stderr)
        return 2
    empty = not any(recordings(study / "raw"))
    if empty and study == REPO and (code := _call("plumbline", "demo", str(REPO / "raw"))):
        return code
    if empty and (study / MAKER).is_file() and (code := _call("python", str(study / MAKER))):
        return code
    if not any(o.startswith(("-c", "-j", "--cores", "--jobs")) for o in options):
        options = [f"--cores={os.cpu_count() or 1}", *options]
    base = ["-s", str(REPO / "Snakefile"), "-d", str(study)]
    if code := _call("snakemake", *base, "--rerun-incomplete", *options):
        if (study / ".snakemake" / "locks").is_dir() and any((study / ".snakemake" / "locks").iterdir()):
            print(f"If no other run is at work here, free the folder with: {BIN / 'snakemake'} {' '.join(base)} --unlock", file=sys.stderr)
        return code
    page, archive = study / "results" / "report.html", study / "results" / "report.zip"
    if page.is_file() and not (archive.is_file() and archive.stat().st_mtime >= page.stat().st_mtime):
        command = [str(BIN / _exe("snakemake")), *base, "--report", "results/report.zip", "--quiet", "all"]
        done = subprocess.run(command, cwd=REPO, capture_output=True, text=True)
        # its page generator warns of file names that begin with `_`; only a failure is worth showing
        print(f"Report: {page}" if not done.returncode else f"the Snakemake report could not be made:\n{done.stderr}", flush=True)
        return done.returncode
    return 0


def test(arguments: list[str]) -> int:
    """`test [pytest options]`."""
    return _call("pytest", *arguments)


def check(arguments: list[str]) -> int:
    """Lint, format, types, rules: all are run, the worst exit code counts."""
    rules = ["Snakefile", *map(str, sorted([*REPO.glob("workflow/rules/*.smk"), *REPO.glob("studies/*/paper.smk")]))]
    jobs = [
        ("ruff", "check", "."),
        ("ruff", "format", "--check", "."),
        ("mypy",),
        ("snakefmt", "--check", *rules),
        ("plumbline", "lint"),
    ]
    return max([_call(*job) for job in jobs])


def papers(arguments: list[str]) -> int:
    """Compare results with the committed references."""
    return run([]) or _call("plumbline", "papers")


def _exe(name: str) -> str:
    return f"{name}.exe" if os.name == "nt" else name


def _call(program: str, *arguments: str) -> int:
    sys.stdout.flush()
    return subprocess.run([str(BIN / _exe(program)), *arguments], cwd=REPO).returncode
