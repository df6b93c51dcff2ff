"""Run the benchmarks: `python -m benchmarks [NAME [OPTIONS]]`; every module here with a main() is one.

main(options) returns the rows of a table, dictionaries with the same keys, or prints its tables itself and returns None; the first
line of the module's docstring is the title.
"""

import importlib
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from plumbline.bootstrap import ENVIRONMENT

HERE = Path(__file__).resolve().parent


def names() -> list[str]:
    """Benchmarks in alphabetical order; files that begin with `_` are parts of others."""
    return sorted(p.stem for p in HERE.glob("[!_]*.py"))


def table(rows: Sequence[Mapping[str, object]]) -> str:
    """Rows as text, columns aligned: numbers to three digits at the right, words at the left."""
    if not rows:
        return "(nothing)"
    words = [[f"{v:.3g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows]
    right = [all(isinstance(row[key], int | float) for row in rows) for key in rows[0]]
    lines = [list(rows[0]), *words]
    widths = [max(len(line[i]) for line in lines) for i in range(len(right))]
    rule = ["-" * w for w in widths]
    cells = [[t.rjust(w) if r else t.ljust(w) for t, w, r in zip(line, widths, right, strict=True)] for line in [lines[0], rule, *words]]
    return "\n".join("  ".join(line).rstrip() for line in cells)


def main(arguments: Sequence[str]) -> int:
    """Run the named benchmark with its options, or all."""
    wanted, options = list(arguments[:1]) or names(), arguments[1:]
    if unknown := set(wanted) - set(names()):
        print(f"no benchmark called {unknown.pop()}; there are {', '.join(names())}", file=sys.stderr)
        return 2
    os.environ.update(ENVIRONMENT)  # before anything imports numpy
    for name in wanted:
        module = importlib.import_module(f"benchmarks.{name}")
        if hasattr(module, "main"):
            print(f"\n{name}: {(module.__doc__ or '').splitlines()[0]}\n", flush=True)
            if (rows := module.main(options)) is not None:
                print(table(rows), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
