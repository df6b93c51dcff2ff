"""The catalogue of effects: every file of this folder that defines EFFECT, and every file of a study's own `effects/`.

A file with an error is named with its line and the others go on.
"""

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from plumbline.effects._channels import Channels
from plumbline.effects._effect import Effect, Parameter

__all__ = ["Catalogue", "Channels", "Effect", "Parameter", "catalogue", "where"]

HERE = Path(__file__).resolve().parent
DATA_FILES = ("*.py",)  # found by themselves, so the digest of the code must count them all


class Catalogue(dict[str, Effect]):
    """id -> Effect, in the order of ids, the study's own last; `broken`: (file, what is wrong and in which line)."""

    broken: list[tuple[str, str]]


class _Loaded(NamedTuple):
    effect: Effect | None
    error: str


def catalogue(study: Path | None = None) -> Catalogue:
    """The effects of the library, and those of the study in folder `study` (its `effects/*.py`, which win where ids are the same)."""
    out = Catalogue()
    out.broken = []
    study = study.resolve() if study else None  # a trace of an error names files whole
    for file in [*_files(HERE), *(_files(study / "effects") if study else ())]:
        effect, error = _load(file)
        if effect is None:
            out.broken.append((str(file.relative_to(study) if study and file.is_relative_to(study) else file.name), error))
        else:
            out.pop(file.stem, None)
            out[file.stem] = replace(effect, id=file.stem, file=str(file))
    return out


def _files(folder: Path) -> Iterator[Path]:
    yield from sorted(f for f in folder.glob("*.py") if not f.name.startswith("_"))


def _load(file: Path) -> _Loaded:
    """The EFFECT of a file, or what is wrong with it in words."""
    if file.parent == HERE:
        return _Loaded(importlib.import_module(f"plumbline.effects.{file.stem}").EFFECT, "")
    name = f"plumbline_study_effect_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        return _Loaded(None, "cannot be loaded as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # a user's file may fail in any way; the reason is handed on whole
        return _Loaded(None, where(error, file))
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        return _Loaded(None, "defines no EFFECT = Effect(...)")
    return _Loaded(effect, "")


def where(error: BaseException, file: Path) -> str:
    """`line 7: NameError: ...` of an error raised in a file."""
    line = error.lineno if isinstance(error, SyntaxError) and error.filename == str(file) else None
    for frame in traceback.extract_tb(error.__traceback__):
        line = frame.lineno if frame.filename == str(file) else line
    said = error.msg if isinstance(error, SyntaxError) else error
    return f"{f'line {line}: ' if line else ''}{type(error).__name__}: {said}"
