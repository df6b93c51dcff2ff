"""Marker sets: which markers bound which body segment, and the segment's numbers.

A set is a YAML file::

    about: whose labels these are                          # optional
    aliases: {RPSI: [SACR]}                                # optional: other labels for the same marker
    points:                                                # optional: points made from markers, in this order
      RHJC: {hip: right, asis: [RASI, LASI], psis: [RPSI, LPSI]}            # Harrington 2007
      RKJC: {at: [RKNE], from: [RHJC], to: [LHJC], share: 0.3}              # at + share * (to - from)
      RWJC: {mean: [RWRA, RWRB]}
      OMPH: {at: [RHJC, LHJC], from: [RHJC, LHJC], to: [RSHO, LSHO], share: {F: 0.365, M: 0.283}, carried: [RASI, LASI, RPSI, LPSI]}
    segments:
      trunk:       {proximal: [C7], distal: [RHIP, LHIP], mass: 0.4346, com: 0.5138, gyration: 0.328}
      thigh_right: {proximal: [RHIP], distal: [RKNE], table: de-leva-1996/thigh}
    support: {left: [LHEE, LTOE], right: [RHEE, RTOE], half_width: 0.05}    # optional: the feet's outline, widened [m]

``proximal`` and ``distal`` are means of the markers named. ``mass`` is a share of the body, ``com`` (from the proximal end) and
``gyration`` (about the segment's transverse axes) are shares of the length. A ``share`` may differ by sex (the mean of both where the
sex is not stated). A ``carried`` point is put there at the trial's upright moment, when the line ``from`` - ``to`` stands (`rigid.py`), and
goes with these three or more markers (or points made before) ever after; in a file that has fewer than three of them it stays on the
line. With ``upright: true`` the way from ``at`` goes straight up in each frame, as long as at that moment: a head that looks ahead.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from plumbline import landmarks, segments
from plumbline.errors import PlumblineError
from plumbline.segments import Numbers

DATA_FILES = ("markersets/*.yaml",)  # part of this module for plumbline/provenance.py
BUILT_IN = Path(__file__).parent / "markersets"
MIN_SHARE = 0.3  # [1] of body mass a built-in set must explain to be taken for the file's set: two legs

_LABELS = {"type": "array", "minItems": 1, "items": {"type": "string", "minLength": 1}}
_SHARE = {"type": "number", "exclusiveMinimum": 0, "maximum": 1}


def _map(required: list[str], **properties: Any) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": False, "required": required, "properties": properties}


_SEGMENT = _map(
    ["proximal", "distal"],
    proximal=_LABELS,
    distal=_LABELS,
    table={"type": "string"},
    mass=_SHARE,
    com={"type": "number", "minimum": -1, "maximum": 2},
    gyration={"type": "number", "minimum": 0, "maximum": 2},
)
_POINT = _map(
    [],
    mean=_LABELS,
    at=_LABELS,
    **{"from": _LABELS, "to": _LABELS},
    share={
        "type": ["number", "object"],
        "additionalProperties": False,
        "required": ["F", "M"],
        "properties": {"F": {"type": "number"}, "M": {"type": "number"}},
    },
    upright={"const": True},
    carried={**_LABELS, "minItems": 3, "uniqueItems": True},
    hip={"enum": ["left", "right"]},
    asis={**_LABELS, "minItems": 2, "maxItems": 2},
    psis=_LABELS,
)
_LINE = {"at", "from", "to", "share"}
_FORMS = ({"mean"}, _LINE, {*_LINE, "carried"}, {*_LINE, "upright"}, {"hip", "asis", "psis"})
_NEEDED = ("mean", "at", "from", "to", "asis", "psis")  # keys whose points must be there for the made point to be
SCHEMA = _map(
    ["segments"],
    about={"type": "string"},
    aliases={"type": "object", "additionalProperties": _LABELS},
    points={"type": "object", "additionalProperties": _POINT},
    segments={"type": "object", "minProperties": 1, "additionalProperties": _SEGMENT},
    support=_map(["left", "right"], left=_LABELS, right=_LABELS, half_width={"type": "number", "minimum": 0, "maximum": 0.3}),
)


@dataclass(frozen=True)
class Segment:
    """One segment: the markers at its ends, and either a table's row or own numbers."""

    name: str
    proximal: tuple[str, ...]
    distal: tuple[str, ...]
    table: str = ""
    own: Numbers | None = None

    @property
    def markers(self) -> tuple[str, ...]:
        """Markers of both ends."""
        return self.proximal + self.distal

    def numbers(self, sex: str) -> Numbers:
        """Parameters for ``sex`` "M", "F" or "" (mean of both)."""
        return self.own if self.own is not None else segments.numbers(self.table, sex)


@dataclass(frozen=True)
class MarkerSet:
    """A marker set as read; ``notes`` says in words what was taken for granted or looks odd."""

    name: str
    segments: tuple[Segment, ...]
    points: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    aliases: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    support: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    half_width: float | None = None  # [m] by which the outline is widened; None: not stated
    notes: tuple[str, ...] = ()

    def resolve(self, labels: Iterable[str]) -> dict[str, str]:
        """Marker name in the set -> label in the file (subject prefixes dropped, aliases tried)."""
        have = landmarks.base_names(labels)
        found = dict(have)
        for name, others in self.aliases.items():
            other = next((have[o] for o in others if o in have), None)
            if name not in found and other is not None:
                found[name] = other
        return found

    def available(self, labels: Iterable[str]) -> set[str]:
        """Names that can be had from a file with these labels, made points included."""
        names = set(self.resolve(labels))
        for point, spec in self.points.items():
            if point not in names and names.issuperset(point_inputs(spec)):
                names.add(point)
        return names

    def share(self, labels: Iterable[str], sex: str = "") -> float:
        """Share of body mass whose segments have their markers among the labels."""
        names = self.available(labels)
        return sum(s.numbers(sex).mass for s in self.segments if names >= set(s.markers))


def point_inputs(spec: Mapping[str, Any]) -> list[str]:
    """Names a made point needs, in the order of its keys; the markers that carry it are not among them: it can do without."""
    return list(dict.fromkeys(name for key in _NEEDED for name in spec.get(key, ())))


def share_of(spec: Mapping[str, Any], sex: str) -> float:
    """Share [1] of the line at which a made point lies for ``sex`` "M", "F" or "" (mean of both)."""
    share = spec["share"]
    if not isinstance(share, Mapping):
        return float(share)
    return float(share[sex]) if sex else (share["F"] + share["M"]) / 2.0


def built_in() -> list[str]:
    """Names of the built-in sets, sorted."""
    return sorted(f.stem for f in BUILT_IN.glob("*.yaml"))


@cache
def named(name: str) -> MarkerSet:
    """A built-in set.  Raises PlumblineError with the nearest name where there is none."""
    if name not in built_in():
        near = get_close_matches(name, built_in(), n=1)
        advice = f"did you mean '{near[0]}'?" if near else f"built in: {', '.join(built_in())}"
        raise PlumblineError(f"markerset '{name}': no such built-in set; {advice}")
    return load(BUILT_IN / f"{name}.yaml", name)


def match(labels: Iterable[str]) -> str:
    """Name of the built-in set that explains most body mass with these labels; "" where none explains a pair of legs.

    Ties go to the set of which more markers are there, then to the first name.
    """
    have = list(labels)
    scores = []
    for name in built_in():
        one = named(name)
        needs = {m for s in one.segments for m in s.markers}
        scores.append((-round(one.share(have), 6), -len(needs & one.available(have)) / len(needs), name))
    best = min(scores)
    return best[2] if -best[0] >= MIN_SHARE else ""


def load(path: Path, name: str = "") -> MarkerSet:
    """Read a marker set.

    Raises PlumblineError naming file, segment and key for a malformed file, an unknown table or a row on other landmarks.
    """
    try:
        raw = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise PlumblineError(f"{path.name}: not readable as YAML: {' '.join(str(error).split())}") from error
    return parse(raw, path.name, name or path.stem)


def parse(raw: Any, source: str, name: str) -> MarkerSet:
    """Check a marker set given as plain maps and lists; `source` stands in the messages.  Raises PlumblineError."""
    _validate(raw, source)
    notes: list[str] = []
    parts = tuple(_segment(source, key, spec, notes) for key, spec in raw["segments"].items())
    _check_points(source, raw.get("points", {}))
    total = sum(s.numbers("").mass for s in parts)
    if total > 1.02:
        raise PlumblineError(f"{source}: the segments' masses add up to {total:.3f} of the body, more than 1")
    support = raw.get("support", {})
    return MarkerSet(
        name,
        parts,
        raw.get("points", {}),
        {k: tuple(v) for k, v in raw.get("aliases", {}).items()},
        {side: tuple(support[side]) for side in ("left", "right") if side in support},
        support.get("half_width"),
        tuple(notes),
    )


def _segment(source: str, key: str, spec: Mapping[str, Any], notes: list[str]) -> Segment:
    where = f"{source}, segment '{key}'"
    ends = tuple(spec["proximal"]), tuple(spec["distal"])
    own = [k for k in ("mass", "com", "gyration") if k in spec]
    if "table" in spec and own:
        raise PlumblineError(f"{where}, key 'table': give a table or own {', '.join(own)}, not both")
    if "table" in spec:
        try:
            row = segments.row(spec["table"])
        except PlumblineError as error:
            raise PlumblineError(f"{where}, key {error}") from error
        notes += landmarks.check_row(where, *ends, spec["table"], row)
        return Segment(key, *ends, table=spec["table"])
    lacks = [k for k in ("mass", "com", "gyration") if k not in spec]
    if lacks:
        raise PlumblineError(f"{where}, key '{lacks[0]}': missing; give mass, com and gyration, or a table")
    values = Numbers(float(spec["mass"]), float(spec["com"]), float(spec["gyration"]), float(spec["gyration"]), float("nan"))
    notes += landmarks.lookalike(where, *ends, values)
    return Segment(key, *ends, own=values)


def _check_points(source: str, points: Mapping[str, Mapping[str, Any]]) -> None:
    for name, spec in points.items():
        if set(spec) not in _FORMS:
            forms = " or ".join("{" + ", ".join(sorted(f)) + "}" for f in _FORMS)
            raise PlumblineError(f"{source}, point '{name}': keys {sorted(spec)}; a point is given by {forms}")


def _validate(raw: Any, source: str) -> None:
    if not isinstance(raw, dict):
        raise PlumblineError(f"{source}: holds no map; a marker set starts with 'segments:'")
    problems = sorted(jsonschema.Draft202012Validator(SCHEMA).iter_errors(raw), key=lambda e: [str(p) for p in e.absolute_path])
    if problems:
        raise PlumblineError("; ".join(f"{source}{_place(e)}: {_reason(e)}" for e in problems))


def _place(error: Any) -> str:
    path = [str(p) for p in error.absolute_path]
    kind = {"segments": "segment", "points": "point", "aliases": "alias"}.get(path[0], "key") if path else ""
    named_part = f", {kind} '{path[1]}'" if len(path) > 1 and kind != "key" else ""
    rest = path[2:] if named_part else path
    return named_part + (f", key '{'.'.join(rest)}'" if rest else "")


def _reason(error: Any) -> str:
    if error.validator == "additionalProperties":
        known = list(error.schema.get("properties", {}))
        unknown = sorted(str(k) for k in set(error.instance) - set(known))
        near = get_close_matches(unknown[0], known, n=1, cutoff=0.5)
        return f"unknown key '{unknown[0]}'; " + (f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}")
    return str(error.message)


def choose(wanted: str, labels: Iterable[str]) -> MarkerSet | None:
    """The marker set for one file: a markerset.yaml (its path), a built-in set by name, or the one that fits ("auto").

    None where "auto" finds none.  Raises PlumblineError for an unknown name or a malformed file.
    """
    if wanted.endswith((".yaml", ".yml")):
        return load(Path(wanted))
    name = match(labels) if wanted == "auto" else wanted
    return named(name) if name else None


def describe(labels: set[str], own: Path | None, wanted: str) -> str:
    """In words: which set a file's labels fit and what share of the body that gives."""
    seen = {label for label in labels if not label.startswith("@")}
    if not seen:
        return "no markers"
    chosen = choose(str(own) if own and wanted == "auto" else wanted, seen)
    if chosen is None:
        return f"no marker set fits its labels ({', '.join(sorted(seen)[:6])}, ...): write a markerset.yaml; no CoM from segments"
    share = chosen.share(seen)
    return f"marker set {chosen.name}: {100 * share:.0f} % of body mass" + ("" if share >= 0.9 else ", under 90 %: no CoM from it")
