"""Files with their own names: write recordings.tsv from a pattern instead of renaming anything."""

import re
from collections.abc import Iterator
from pathlib import Path

from plumbline.config import study_config
from plumbline.errors import PlumblineError
from plumbline.study import find, side_file

FIELDS = {"participant": "participant_id", "session": "session", "task": "task", "acq": "acq", "run": "run"}


def expression(pattern: str) -> re.Pattern[str]:
    """Regular expression of a pattern such as ``{participant}_{task}_{run}.c3d``; ``*`` stands for anything.

    A field takes letters and digits as BIDS asks (and ``-``, dropped later), not ``_``, ``.`` or ``/``; the pattern is held against
    the end of a path below raw/.
    Raises PlumblineError for an unknown or repeated field, or for a pattern without {participant}.
    """
    out, seen = "", set()
    for piece in re.split(r"(\{[^}]*\}|\*)", pattern):
        if piece.startswith("{"):
            name = piece[1:-1]
            if name not in FIELDS or name in seen:
                known = ", ".join("{" + k + "}" for k in FIELDS)
                raise PlumblineError(f"pattern '{pattern}': {piece} is unknown or stands twice; known: {known}, and * for anything")
            seen.add(name)
            out += f"(?P<{name}>[^_./\\\\]+)"
        else:
            out += "[^/]*" if piece == "*" else re.escape(piece)
    if "participant" not in seen:
        raise PlumblineError(f"pattern '{pattern}': needs {{participant}}")
    return re.compile(rf"(?:.*/)?{out}$", re.IGNORECASE)


def adopt(folder: Path, pattern: str, *, task: str = "", force: bool = False) -> Iterator[str]:
    """Write `recordings.tsv` beside config.yaml for the files below raw/ that fit a pattern; yields lines to print.

    folder: the study.  pattern: see :func:`expression`.  task: for names without {task}.
    Raises PlumblineError where nothing fits, where a task is missing, or where a table is there and `force` is not given.
    """
    raw = study_config(folder)["raw"]
    there = side_file(folder, folder / raw, "recordings.tsv")
    if there and not force:
        raise PlumblineError(f"{there} is there already; --force replaces it (a copy beside config.yaml wins over one in raw/)")
    fits = expression(pattern)
    if "{task}" not in pattern and not task:
        raise PlumblineError(f"pattern '{pattern}' has no {{task}}: name the task with --task, e.g. --task quiet")
    study = find(folder, raw)
    names = sorted({str(f.relative_to(study.raw)) for t in study.trials for f in t.files} | {e.file for e in study.exclusions})
    rows, left = [], []
    for name in names:
        match = fits.match(Path(name).as_posix())
        if match:
            got = {"task": task, **match.groupdict()}
            rows.append([name, *(_clean(got.get(k) or "") for k in FIELDS)])
        else:
            left.append(name)
    if not rows:
        raise PlumblineError(f"no file below {study.raw} fits '{pattern}'; the first is '{names[0] if names else 'none'}'")
    alike = [row for row in rows if sum(row[1:] == other[1:] and _ending(row) == _ending(other) for other in rows) > 1]
    if alike:
        both = ", ".join(row[0] for row in alike[:4])
        raise PlumblineError(f"pattern '{pattern}': {both} would be one trial; tell them apart with {{run}}, {{acq}} or {{session}}")
    target = folder / "recordings.tsv"
    lines = ["\t".join(["file", *FIELDS.values()]), *("\t".join(row) for row in rows)]
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")
    yield f"{target}: {len(rows)} files"
    yield from (f"not taken (does not fit the pattern): {name}" for name in left)


def _ending(row: list[str]) -> str:
    return Path(row[0]).suffix.lower()


def _clean(value: str) -> str:
    return re.sub(r"[\W_]+", "", value)
