"""What a study holds: its trials, participants and events, found by name; nothing is read here but small text files.

Imports no numpy or pandas: the Snakefile calls it at each start.
"""

import csv
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from plumbline.errors import PlumblineError

SIDE_NAME = re.compile(
    r"(participants\.(tsv|json)|recordings\.tsv|markerset\.yaml|(readme|licen[sc]e|changes)(\.[\w.-]+)?|.*_events\.(tsv|json)"
    r"|.*\.(md|xml|json|ya?ml|html|pdf|png|jpe?g))",
    re.IGNORECASE,
)
"""Files that describe; every other file below raw/ is read or named in the exclusions, never passed over."""

MISNAMED = {
    "mass_kg": ("mass", "weight", "weight_kg", "bodymass", "body_mass"),
    "height_m": ("height", "height_cm", "stature", "body_height"),
    "sex": ("gender",),
}
"""Columns of participants.tsv by names that other labs give them: their units are not known, so they are not taken."""

ENTITIES = ("sub", "ses", "task", "acq", "run")


@dataclass(frozen=True)
class Participant:
    """One row of participants.tsv.  sex: "M", "F" or "" (then both sexes' segment tables are averaged)."""

    subject: str
    mass: float | None = None  # [kg]
    height: float | None = None  # [m]
    sex: str = ""


@dataclass(frozen=True)
class Trial:
    """All files with the same entities: one trial (a .trc and its .mot are one).

    trial: unique name.  files: paths as found below raw/.  events: the events file or None.
    """

    trial: str
    subject: str
    session: str
    task: str
    condition: str
    run: str
    files: tuple[Path, ...]
    events: Path | None = None

    def plain(self) -> dict[str, Any]:
        """As strings and lists, for a rule's params; `Trial.of` is its inverse."""
        out = asdict(self)
        return {**out, "files": [str(f) for f in self.files], "events": str(self.events) if self.events else ""}

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> "Trial":
        """Build from :meth:`plain`."""
        files = tuple(Path(f) for f in plain["files"])
        return cls(**{**plain, "files": files, "events": Path(plain["events"]) if plain["events"] else None})


def names(trial: str, task: str, files: Iterable[str | Path]) -> set[str]:
    """What a config may call a trial: its task, its id, the task with its run (`squats_run-01`), a file name without ending."""
    run = next((e for e in trial.split("_") if e.startswith("run-")), "")
    return {task, trial, f"{task}_{run}", *(Path(f).stem for f in files)}


def check_names(trials: Iterable[Trial], wanted: Mapping[str, Iterable[str]]) -> None:
    """Raise PlumblineError for a name in the config that no trial has, with the nearest one.

    wanted: key of the config -> the names given there.
    """
    trials = list(trials)
    known = sorted({n for t in trials for n in names(t.trial, t.task, t.files)})
    for key, given in wanted.items():
        for name in given:
            if name not in known:
                near = get_close_matches(name, known, n=1)
                advice = f"did you mean '{near[0]}'?" if near else f"tasks here: {', '.join(sorted({t.task for t in trials}))}"
                raise PlumblineError(f"{key}: no trial, task or file is called '{name}'; {advice}")


def check_comparison(trials: Iterable[Trial], train: Sequence[str], test: Sequence[str]) -> None:
    """Raise PlumblineError for a comparison that cannot be made: unknown names, nothing to test on, nothing left to train on."""
    trials = list(trials)
    check_names(trials, {"evaluation.train": train, "evaluation.test": test})
    if train and not test:
        raise PlumblineError("evaluation.train needs evaluation.test: what should be judged?")
    called = [names(t.trial, t.task, t.files) for t in trials]
    if test and not any((not train or n & set(train)) and not n & set(test) for n in called):
        raise PlumblineError("evaluation: every trial of train is in test too (a trial on both sides is tested only): nothing to fit on")


@dataclass(frozen=True)
class Exclusion:
    """A file that no trial uses: file below raw/, reason code, message, hint."""

    file: str
    reason: str
    message: str
    hint: str


@dataclass(frozen=True)
class Study:
    """Everything the Snakefile needs to know: trials sorted by name, participants by subject, files that no trial uses."""

    folder: Path
    raw: Path
    trials: tuple[Trial, ...]
    participants: dict[str, Participant]
    exclusions: tuple[Exclusion, ...]
    markerset: Path | None

    @property
    def subjects(self) -> list[str]:
        """Subjects with at least one trial, sorted."""
        return sorted({t.subject for t in self.trials})


def find(folder: Path, raw: str = "raw") -> Study:
    """Find the trials of a study.

    folder: the study.  raw: the folder of recordings, relative to the study or absolute.
    Raises PlumblineError for an absent raw folder or for a malformed participants.tsv or recordings.tsv, with line and column.
    """
    base = folder / raw
    if not base.is_dir():
        raise PlumblineError(f"{base}: no such folder; put the recordings there or set `raw:` in config.yaml")
    found = sorted(recordings(base))
    table = side_file(folder, base, "recordings.tsv")
    trials, exclusions = _listed(base, found, table) if table else _named(base, found)
    people = _participants(side_file(folder, base, "participants.tsv"))
    trials = [replace(t, events=_events(folder, base, t)) for t in trials]
    return Study(
        folder,
        base,
        tuple(sorted(trials, key=lambda t: t.trial)),
        people,
        tuple(exclusions),
        side_file(folder, base, "markerset.yaml"),
    )


def side_file(folder: Path, raw: Path, name: str) -> Path | None:
    """A small file that may lie beside config.yaml or in raw/; the one beside config.yaml wins."""
    return next((f for f in (folder / name, raw / name) if f.is_file()), None)


def recordings(raw: Path) -> Iterator[Path]:
    """Files below raw/ that are no side files; links are followed, hidden files and folders are not."""
    seen = {os.path.realpath(raw)}
    for where, folders, files in os.walk(raw, followlinks=True):
        inside = {f: os.path.realpath(os.path.join(where, f)) for f in sorted(folders) if not f.startswith(".")}
        folders[:] = [f for f, real in inside.items() if real not in seen]  # a link back up would never end
        seen |= set(inside.values())
        yield from (Path(where) / f for f in files if not f.startswith(".") and not SIDE_NAME.fullmatch(f))


# -- names ------------------------------------------------------------------------------------------------------------


def entities(stem: str) -> dict[str, str] | None:
    """BIDS entities of a file name without ending, or None where it follows no such pattern; a suffix such as `_grf` may follow."""
    parts = stem.split("_")
    if len(parts) > 2 and parts[-1].isalpha():
        parts.pop()
    pairs = [part.split("-", 1) for part in parts]
    if any(len(p) != 2 or not p[1] for p in pairs):
        return None
    got = {k: v for k, v in pairs}
    order = [k for k, _ in pairs]
    known = all(k in ENTITIES for k in order) and order == [k for k in ENTITIES if k in got] and len(got) == len(pairs)
    return got if known and "sub" in got and "task" in got else None


def with_sub(subject: str) -> str:
    """A participant id with its `sub-`."""
    return subject if subject.startswith("sub-") else f"sub-{subject}"


def _trial(got: Mapping[str, str], files: Iterable[Path]) -> Trial:
    clean = {k: got.get(k, "") for k in ENTITIES}
    clean["sub"] = clean["sub"].removeprefix("sub-")
    name = "_".join(f"{k}-{clean[k]}" for k in ENTITIES if clean[k])
    return Trial(name, f"sub-{clean['sub']}", clean["ses"], clean["task"], clean["acq"], clean["run"], tuple(sorted(files)))


def _group(pairs: Iterable[tuple[dict[str, str], Path]]) -> list[Trial]:
    together: dict[tuple[tuple[str, str], ...], list[Path]] = {}
    for got, file in pairs:
        together.setdefault(tuple(sorted((k, v) for k, v in got.items() if v)), []).append(file)
    return [_trial(dict(key), files) for key, files in together.items()]


def _named(raw: Path, found: list[Path]) -> tuple[list[Trial], list[Exclusion]]:
    pairs, exclusions = [], []
    for file in found:
        got = entities(file.stem)
        if got:
            pairs.append((got, file))
        else:
            exclusions.append(
                Exclusion(
                    str(file.relative_to(raw)),
                    "not_named",
                    f"{file.name} is not named like sub-01_task-lateral_run-01{file.suffix}",
                    "rename it, or list it in recordings.tsv (`plumbline adopt` writes that file)",
                )
            )
    return _group(pairs), exclusions


def _listed(raw: Path, found: list[Path], table: Path) -> tuple[list[Trial], list[Exclusion]]:
    pairs, exclusions, used = [], [], set()
    for line, row in _rows(table, required=("file", "participant_id", "task")):
        file = raw / row["file"]
        for column in ("file", "participant_id", "task"):
            if not row[column]:
                raise PlumblineError(f"{table}: line {line}: column {column} is empty")
        if file in used:
            raise PlumblineError(f"{table}: line {line}: {row['file']} stands there twice")
        used.add(file)
        if not file.is_file():
            exclusions.append(
                Exclusion(row["file"], "missing_file", f"{table.name} line {line} lists {row['file']}, which is not in {raw.name}/",
                          "correct the name or remove the line")
            )  # fmt: skip
            continue
        got = {"sub": row["participant_id"].removeprefix("sub-"), "ses": row.get("session", ""), "task": row["task"]}
        got |= {"acq": row.get("acq", ""), "run": row.get("run", "")}
        pairs.append(({k: _entity(v, table, line, k) for k, v in got.items()}, file))
    exclusions += [
        Exclusion(
            str(f.relative_to(raw)),
            "not_listed",
            f"{table.name} does not list {f.name}",
            f"if it is a recording, add a line for it to {table.name}",
        )
        for f in found
        if f not in used
    ]
    return _group(pairs), exclusions


def _entity(value: str, table: Path, line: int, column: str) -> str:
    value = "" if value.lower() == "n/a" else value.strip()
    if value and not re.fullmatch(r"[^\W_]+", value):
        raise PlumblineError(f"{table}: line {line}: '{value}' ({column}) may hold letters and digits only, as BIDS asks")
    return value


def _events(folder: Path, raw: Path, trial: Trial) -> Path | None:
    """The events file: beside config.yaml, else beside the recording, named after the trial or after a file of it."""
    stems = [trial.trial, *(f.stem for f in trial.files)]
    places = [folder, folder / "events", *(f.parent for f in trial.files)]
    return next((f for p in places for s in stems if (f := p / f"{s}_events.tsv").is_file()), None)


# -- tables -----------------------------------------------------------------------------------------------------------


def _rows(table: Path, required: tuple[str, ...]) -> Iterator[tuple[int, dict[str, str]]]:
    """Rows of a tab-separated file with their line numbers."""
    with table.open(encoding="utf-8-sig", newline="") as handle:
        reader = csv.DictReader(handle, delimiter="\t")
        header = [h.strip() for h in reader.fieldnames or []]
        for name in required:
            if name not in header:
                raise PlumblineError(f"{table}: no column '{name}'; it has: {', '.join(header) or 'nothing'} (tab-separated?)")
        reader.fieldnames = header
        for row in reader:
            if any(isinstance(v, str) and v.strip() for v in row.values()):
                yield reader.line_num, {k: (v or "").strip() for k, v in row.items() if isinstance(k, str)}


def _participants(table: Path | None) -> dict[str, Participant]:
    if table is None:
        return {}
    people: dict[str, Participant] = {}
    for line, row in _rows(table, required=("participant_id",)):
        for column, others in MISNAMED.items():
            wrong = next((c for c in row if column not in row and c.lower() in others), None)
            if wrong:
                raise PlumblineError(f"{table}: column '{wrong}': did you mean '{column}'?")
        subject = with_sub(row["participant_id"])
        if subject in people:
            raise PlumblineError(f"{table}: line {line}: {subject} stands there twice")
        people[subject] = Participant(
            subject,
            _number(table, line, "mass_kg", row.get("mass_kg", ""), 10.0, 400.0),
            _number(table, line, "height_m", row.get("height_m", ""), 0.5, 2.6),
            _sex(table, line, row.get("sex", "")),
        )
    return people


def _number(table: Path, line: int, column: str, text: str, low: float, high: float) -> float | None:
    if text.lower() in ("", "n/a", "nan"):
        return None
    try:
        value = float(text)
    except ValueError:
        raise PlumblineError(f"{table}: line {line}, column {column}: '{text}' is no number (write n/a where not known)") from None
    if not low <= value <= high:
        raise PlumblineError(f"{table}: line {line}, column {column}: {value:g} is outside {low:g} to {high:g}; is the unit right?")
    return value


def _sex(table: Path, line: int, text: str) -> str:
    known = {"m": "M", "male": "M", "f": "F", "female": "F", "": "", "n/a": "", "o": "", "other": ""}
    if text.lower() not in known:
        raise PlumblineError(f"{table}: line {line}, column sex: '{text}' is none of M, F, n/a")
    return known[text.lower()]


# -- parts ------------------------------------------------------------------------------------------------------------


def assign(subjects: Iterable[str], size: int, before: Mapping[str, str] | None = None) -> dict[str, str]:
    """Part of each subject: a subject keeps its part; a new one joins a part with room, else opens a new one.

    size: subjects per part.  before: the last run's assignment, made for the same size.
    So a subject inserted anywhere changes one part only. Returns subject -> "part-0001", in the order of the subjects.
    """
    known = set(subjects)
    kept = {s: p for s, p in (before or {}).items() if s in known}
    load: dict[str, int] = {}
    for part in kept.values():
        load[part] = load.get(part, 0) + 1
    number = max((int(p.rsplit("-", 1)[1]) for p in load), default=0)
    room = [p for p in sorted(load) if load[p] < size]
    for subject in sorted(known - set(kept)):
        if not room:
            number += 1
            room = [f"part-{number:04d}"]
            load[room[0]] = 0
        kept[subject] = room[0]
        load[room[0]] += 1
        if load[room[0]] >= size:
            room.pop(0)
    return {s: kept[s] for s in sorted(kept)}


def read_parts(path: Path, size: int) -> dict[str, str]:
    """The last run's assignment; empty where there was none or where it was made for another size."""
    if not path.is_file():
        return {}
    rows = [r for _, r in _rows(path, required=("subject", "part", "subjects_per_job"))]
    return {r["subject"]: r["part"] for r in rows if r["subjects_per_job"] == str(size)}


def forget_parts(parts: Iterable[str], results: Path) -> list[Path]:
    """Remove tables and figures of parts that are no more, so that a folder stays one whole table; returns what was removed."""
    now = set(parts)
    old = [f for f in results.glob("*/*part-[0-9][0-9][0-9][0-9].*") if f.stem.removeprefix("_") not in now]
    for file in old:
        file.unlink()
    return old


def write_parts(parts: Mapping[str, str], size: int, path: Path) -> None:
    """Keep the assignment for the next run (tab-separated: subject, part, subjects_per_job)."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = "subject\tpart\tsubjects_per_job\n" + "".join(f"{s}\t{p}\t{size}\n" for s, p in parts.items())
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
