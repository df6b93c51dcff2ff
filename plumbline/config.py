"""The config of a study: closed, typed, with defaults and a "did you mean"."""

import json
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema

from plumbline.errors import PlumblineError

if TYPE_CHECKING:  # the Snakefile reads the config at each start and needs no numpy for it
    from plumbline.effects import Catalogue

MARKER_SETS = Path(__file__).resolve().parent / "markersets"
SCHEMAS = Path(__file__).resolve().parents[1] / "workflow" / "schemas"


def config_schema() -> dict[str, Any]:
    """JSON schema of config.yaml, the `columns:` grammar included."""
    schema = json.loads((SCHEMAS / "config.json").read_text(encoding="utf-8"))
    columns = json.loads((SCHEMAS / "columns.json").read_text(encoding="utf-8"))
    schema["properties"]["columns"] = {**columns, "default": []}
    return dict(schema)


def with_defaults(config: Mapping[str, Any] | None, source: str = "config.yaml") -> dict[str, Any]:
    """The config with every default filled in; an absent file, an empty one and ``{}`` are alike.

    Raises PlumblineError naming the key, its place and, for a misspelt key, the nearest known one.
    """
    schema = config_schema()
    filled = _fill(schema, dict(config or {}))
    problems = list(_problems(schema, filled)) or list(_unknown_set(filled["markerset"]))
    if problems:
        raise PlumblineError(f"{source}: " + "; ".join(problems))
    return filled


def _unknown_set(wanted: str) -> Iterator[str]:
    known = sorted(f.stem for f in MARKER_SETS.glob("*.yaml"))
    if wanted not in ("auto", *known):
        near = get_close_matches(wanted, known, n=1)
        yield f"markerset '{wanted}': " + (f"did you mean '{near[0]}'?" if near else f"built in: {', '.join(known)}")


def _fill(schema: Mapping[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    out = dict(given)
    for key, sub in schema.get("properties", {}).items():
        if key not in out and "default" in sub:
            out[key] = sub["default"]
        if out.get(key) is None and key in given and "default" in sub:
            out[key] = sub["default"]  # a key without a value, or a section whose lines are all commented out
        if isinstance(out.get(key), dict) and sub.get("type") == "object":
            out[key] = _fill(sub, out[key])
    return out


def _problems(schema: Mapping[str, Any], config: Mapping[str, Any]) -> Iterator[str]:
    for error in jsonschema.Draft202012Validator(schema).iter_errors(config):
        yield from _explain(error)


def _explain(error: Any) -> Iterator[str]:
    place = ".".join(str(p) for p in error.absolute_path)
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", {}))
        for key in sorted(set(error.instance) - set(known)):
            near = get_close_matches(str(key), known, n=1, cutoff=0.5)
            advice = f"did you mean '{near[0]}'?" if near else f"known here: {', '.join(known)}"
            yield f"unknown key '{place + '.' if place else ''}{key}': {advice}"
    elif error.context:
        deepest = max(error.context, key=lambda e: (len(e.absolute_path), e.validator not in ("const", "type")))
        yield f"'{'.'.join(str(p) for p in deepest.absolute_path)}': {deepest.message}"
    else:
        yield f"'{place}': {error.message}"


def models(config: Mapping[str, Any], known: "Catalogue") -> list[tuple[str, tuple[str, ...]]]:
    """Models that the config lists, in its order: name and effects of each rung above the paper's equation; none for `auto`.

    config: of :func:`with_defaults`.  known: the catalogue of the study.  Raises PlumblineError for an effect that nobody can use.
    """
    chosen = config["models"]
    out = [] if chosen == "auto" else [(str(name), tuple(effects)) for name, effects in chosen.items()]
    for name, effects in out:
        for effect in effects:
            known_effect(effect, known, f"models.{name}: ")
    return out


def known_effect(effect: str, known: "Catalogue", place: str = "") -> None:
    """Raises PlumblineError where the catalogue has no such effect: with the line where its file is broken, else with the nearest name."""
    for file, error in known.broken:
        if Path(file).stem == effect:  # also where the library has one of that name: the study's own was meant
            raise PlumblineError(f"{place}{file} cannot be used: {error}")
    if effect in known:
        return
    near = get_close_matches(effect.lower(), known, n=1, cutoff=0.5)
    advice = f"did you mean '{near[0]}'?" if near else "`plumbline effects` lists them"
    raise PlumblineError(f"{place}no effect is called '{effect}': {advice}")


def study_config(folder: Path) -> dict[str, Any]:
    """The config of the study in a folder, defaults filled in."""
    import yaml  # only here: the Snakefile brings its own

    file = folder / "config.yaml"
    try:
        given = yaml.safe_load(file.read_text(encoding="utf-8")) if file.is_file() else {}
    except yaml.YAMLError as error:
        raise PlumblineError(f"{file}: no valid YAML: {error}") from None
    if given is not None and not isinstance(given, dict):
        raise PlumblineError(f"{file}: must be a map of keys to values")
    return with_defaults(given, str(file))
