"""Which code made a table: the digest of a script and of every plumbline module it imports, transitively.

Snakemake sees the scripts but not the library behind them; each rule carries this digest as a parameter, so an edited module
re-runs what depends on it and nothing else. Imports nothing but the standard library: the Snakefile calls it at each start.
"""

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


@cache
def _module_file(name: str) -> Path | None:
    """The file of a plumbline module; None for names that are no module."""
    base = PACKAGE.joinpath(*name.split(".")[1:])
    for candidate in (base.with_suffix(".py"), base / "__init__.py"):
        if candidate.is_file():
            return candidate
    return None


@cache
def _imports(file: Path) -> tuple[str, ...]:
    """Names of plumbline modules that a file imports, also inside functions."""
    return tuple(sorted(set(_walk(ast.parse(file.read_text(encoding="utf-8"))))))


def _walk(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "plumbline")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "plumbline":
            yield str(node.module)
            # `from plumbline import weak` names a module only if such a file exists
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def files_behind(*starts: Path) -> tuple[Path, ...]:
    """All files that the given files depend on inside the package, themselves included, sorted.

    A package that is imported brings its data files (YAML marker sets, templates, styles) too: they decide results like code does.
    """
    seen: set[Path] = set()
    todo = list(starts)
    while todo:
        file = todo.pop()
        if file in seen:
            continue
        seen.add(file)
        if file.suffix == ".py":
            todo += [f for name in _imports(file) if (f := _module_file(name)) and f != PACKAGE / "__init__.py"]
            todo += _data_files(file)
    return tuple(sorted(seen))


def _data_files(file: Path) -> list[Path]:
    """Data files that a module declares in a line ``DATA_FILES = ("markersets/*.yaml",)``."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and any(getattr(t, "id", "") == "DATA_FILES" for t in node.targets):
            return [f for pattern in ast.literal_eval(node.value) for f in sorted(file.parent.glob(pattern))]
    return []


@cache
def digest(*starts: Path) -> str:
    """First 16 hex digits of a SHA-256 over the names and bytes of :func:`files_behind`."""
    sha = hashlib.sha256()
    for file in files_behind(*starts):
        sha.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return sha.hexdigest()[:16]
