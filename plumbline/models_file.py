"""Add an effect to the config of a study and take it out again; every other byte of the file stays as it is."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from ruamel.yaml import YAML

from plumbline.config import known_effect, models, study_config
from plumbline.effects import Catalogue, catalogue
from plumbline.errors import PlumblineError

REPO = Path(__file__).resolve().parents[1]
Rung = tuple[str, tuple[str, ...]]


def add(folder: Path, effect: str) -> Iterator[str]:
    """Add a rung to `models` of config.yaml: the last one and the effect; yields lines to print.

    folder: the study; its config.yaml is made where there is none.  effect: an id of the catalogue.
    Raises PlumblineError for an unknown effect, or a config that is wrong or written in a way this cannot edit.
    """
    ladder, known = _ladder(folder)
    known_effect(effect, known)
    last = ladder[-1][1] if ladder else ()
    if effect in last:
        yield f"{effect} is in the model '{ladder[-1][0]}' already; nothing changed"
        return
    rung = (_free(f"with_{effect}", ladder), (*last, effect))
    _write(folder, _added(_text(folder), rung), [*ladder, rung])
    yield f"{folder / 'config.yaml'}: the model '{rung[0]}' holds {', '.join(rung[1])}"
    if not ladder:
        yield f"models was auto: now the ladder climbs what the config lists; `plumbline drop {effect}` leads back"
    if known[effect].twin:
        yield f"note: no recording of motion can tell {effect} from {known[effect].twin}; look for no fall of the error"
    yield _next(folder)


def drop(folder: Path, effect: str) -> Iterator[str]:
    """Take an effect out of the last model; a model that then says nothing new goes, and without any `models` is auto again.

    Raises PlumblineError as :func:`add`.
    """
    ladder, known = _ladder(folder)
    if not ladder or effect not in ladder[-1][1]:
        known_effect(effect, known)
        yield f"{effect} is not in the model of the config; nothing changed"
        return
    name, effects = ladder[-1]
    left = tuple(e for e in effects if e != effect)
    before = ladder[-2][1] if len(ladder) > 1 else ()
    kept = [*ladder[:-1], (name, left)] if left != before else ladder[:-1]
    _write(folder, _dropped(_text(folder), effects.index(effect), kept, len(ladder)), kept)
    now = f"the model '{kept[-1][0]}' holds {', '.join(kept[-1][1])}" if kept else "models is auto"
    yield f"{folder / 'config.yaml'}: {effect} is out; {now}"
    yield _next(folder)


def _ladder(folder: Path) -> tuple[list[Rung], Catalogue]:
    known = catalogue(folder.resolve())
    return models(study_config(folder), known), known


def _free(name: str, ladder: list[Rung]) -> str:
    """A name that no model has yet."""
    taken = {n for n, _ in ladder}
    return next(n for n in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if n not in taken)


def _next(folder: Path) -> str:
    if folder.resolve() == REPO:
        return "next: make run"
    return f"next: make run STUDY={folder if folder != Path() else folder.resolve()}"


# -- the text of config.yaml ------------------------------------------------------------------------------------------


class _Place(NamedTuple):
    """Where `models` stands: the root of the document, the key and its value; None where absent."""

    root: Any
    key: Any
    value: Any


def _text(folder: Path) -> str:
    file = folder / "config.yaml"
    return file.read_bytes().decode("utf-8") if file.is_file() else ""


def _place(text: str) -> _Place:
    root = YAML().compose(text)
    pairs = [] if root is None else [(k, v) for k, v in root.value if k.value == "models"]
    return _Place(root, *(pairs[0] if pairs else (None, None)))


def _added(text: str, rung: Rung) -> str:
    """The text with one more model: a line of its own, or an entry where the map stands in braces."""
    root, key, value = _place(text)
    entry = f"{rung[0]}: {_brackets(rung[1])}"
    if key is None:
        if root is not None and root.flow_style:
            return _put(text, root.end_mark.index - 1, f"{', ' if root.value else ''}models: {{{entry}}}")
        return _lines(text, len(text), f"models:\n  {entry}\n")
    if not isinstance(value.value, str):
        if value.flow_style:
            return _put(text, _end(value.value[-1][1]), f", {entry}")
        return _lines(text, _after(text, _end(value)), f"{' ' * value.start_mark.column}{entry}\n")
    start, end = (value.start_mark.index, value.end_mark.index) if value.value else (_colon(text, key),) * 2
    if root.flow_style:
        return _put(text, start, f" {{{entry}}}"[bool(value.value) :], end)
    rest = text[end : _after(text, end)].strip()
    text = _put(text, start, " " * (end - start), end) if rest else _put(text, _colon(text, key), "", end)
    return _lines(text, _after(text, _colon(text, key)), f"  {entry}\n")


def _dropped(text: str, index: int, kept: list[Rung], models: int) -> str:
    """The text without effect number `index` of the last of so many models, or without that model where `kept` has it no more."""
    _, key, value = _place(text)
    name, effects = value.value[-1]
    if len(kept) == models:
        if effects.flow_style:
            return _put(text, effects.start_mark.index, _brackets(kept[-1][1]), effects.end_mark.index)
        return _cut(text, effects.value[index], effects.value[index])
    if not kept and value.flow_style:
        return _put(text, value.start_mark.index, "auto", value.end_mark.index)
    if value.flow_style:
        return _put(text, _end(value.value[-2][1]), "", _end(effects))
    text = _cut(text, name, effects)
    if kept:
        return text
    colon = _colon(text, key)
    room = 5 if text[colon : colon + 6].isspace() and "#" in text[colon : _after(text, colon)] else 0
    return _put(text, colon, " auto", colon + room)


def _brackets(effects: tuple[str, ...]) -> str:
    return f"[{', '.join(effects)}]"


def _end(node: Any) -> int:
    """Index behind the last sign of a node, comments and blank lines below it not counted."""
    if isinstance(node.value, str) or node.flow_style or not node.value:
        return int(node.end_mark.index)
    last = node.value[-1]
    return _end(last[1] if isinstance(last, tuple) else last)


def _after(text: str, at: int) -> int:
    """Index of the line after the one that holds `at`."""
    return text.find("\n", at) + 1 or len(text)


def _colon(text: str, key: Any) -> int:
    return text.index(":", key.end_mark.index) + 1


def _put(text: str, start: int, new: str, end: int | None = None) -> str:
    return text[:start] + new + text[start if end is None else end :]


def _lines(text: str, at: int, new: str) -> str:
    """New lines put in at the start of a line, ended as the file ends its lines."""
    ending = "\r\n" if "\r\n" in text else "\n"
    gap = ending if at and not text[:at].endswith("\n") else ""
    return _put(text, at, gap + new.replace("\n", ending))


def _cut(text: str, first: Any, last: Any) -> str:
    """The text without the lines from one node to another."""
    return _put(text, text.rfind("\n", 0, first.start_mark.index) + 1, "", _after(text, _end(last)))


def _write(folder: Path, text: str, wanted: list[Rung]) -> None:
    """Write the new text, if it says what is wanted and nothing else has changed."""
    file = folder / "config.yaml"
    rungs = {name: list(effects) for name, effects in wanted} or "auto"
    old = yaml.safe_load(_text(folder)) or {}
    try:
        fine = yaml.safe_load(text) == {**old, "models": rungs}
    except yaml.YAMLError:
        fine = False
    if not fine:
        by_hand = yaml.safe_dump({"models": rungs}, default_flow_style=None, sort_keys=False).strip()
        raise PlumblineError(
            f"{file} is written in a way that cannot be edited safely; nothing changed. Write this there yourself:\n{by_hand}"
        )
    file.write_bytes(text.encode("utf-8"))
