"""Points of a C3D: which are markers and which a model's output, their labels and their unit of length."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from plumbline.errors import Refused
from plumbline.readers.layout import Array, Parameters

LENGTHS = {
    "mm": 1e-3,
    "millimeters": 1e-3,
    "millimetres": 1e-3,
    "cm": 1e-2,
    "centimeters": 1e-2,
    "centimetres": 1e-2,
    "m": 1.0,
    "meters": 1.0,
    "metres": 1.0,
    "inches": 0.0254,
    "feet": 0.3048,
}
BODY = (0.5, 2.6)  # [m] largest extent of markers on a person; a factor of ten apart would be ambiguous
PLATE = (0.25, 2.4)  # [m] longest side of a force plate
_NO_LENGTH = re.compile(r"[a-z](Angles?|Forces?|Moments?|Powers?|GRF)$")
_COM = re.compile(r"cent(re|er)[ _]?of[ _]?mass|^(wb)?com([ _]?floor)?$", re.IGNORECASE)


@dataclass
class Sorted:
    """Points by what they are: label -> (n, 3); outputs: labels of angles, forces, ... that are no positions."""

    markers: dict[str, Array] = field(default_factory=dict)
    derived: dict[str, Array] = field(default_factory=dict)
    outputs: list[str] = field(default_factory=list)


def sort_points(points: Array, parameters: Parameters, notes: list[str]) -> Sorted:
    """Markers, derived points and outputs, each under a unique label; points that are never valid are dropped."""
    labels = _labels(parameters.text("POINT", "LABELS"), points.shape[1], notes)
    outputs, model = _groups(parameters)
    bones, found, dead = _bones(labels), Sorted(), list[str]()
    for index, label in enumerate(labels):
        plain = label.split(":")[-1]
        if plain in outputs or _NO_LENGTH.search(plain):
            found.outputs.append(label)
        elif not np.isfinite(points[:, index]).any():
            dead.append(label)
        else:
            derived = plain in model or plain in bones or _COM.search(plain)
            (found.derived if derived else found.markers)[label] = points[:, index]
    if found.outputs:
        notes.append(f"{len(found.outputs)} point channels hold angles, forces, moments or powers: {_some(found.outputs)}")
    if dead:
        notes.append(f"{len(dead)} points are never valid: {_some(dead)}")
    return found


def _groups(parameters: Parameters) -> tuple[set[str], set[str]]:
    """Labels that the file lists as model outputs without a length, and as modelled points."""
    kinds = {
        "ANGLES",
        "FORCES",
        "MOMENTS",
        "POWERS",
        "SCALARS",
        "REACTIONS",
        *parameters.text("POINT", "TYPE_GROUPS")[::2],
    }
    listed = {kind: {t.split(":")[-1] for t in parameters.text("POINT", kind)} for kind in (*kinds, "MODELED_MARKERS")}
    outputs = set().union(*(names for kind, names in listed.items() if kind != "MODELED_MARKERS"))
    return {name for name in outputs if not _COM.search(name)}, listed["MODELED_MARKERS"]


def _bones(labels: Iterable[str]) -> set[str]:
    """Axis points of Plug-in Gait's bones: origin O with all of A, L and P beside it (PELO, PELA, PELL, PELP)."""
    names = {label.split(":")[-1] for label in labels}
    stems = {name[:-1] for name in names if len(name) == 4 and all(name[:-1] + end in names for end in "OALP")}
    return {stem + end for stem in stems for end in "OALP"}


def _labels(stated: list[str], count: int, notes: list[str]) -> list[str]:
    """`count` unique labels: a prefix common to all subjects' labels is cut, repeats get .2, .3, empty ones a number."""
    prefixes = {label.split(":")[0] for label in stated[:count] if ":" in label}
    if len(prefixes) == 1:
        notes.append(f"the subject's prefix {min(prefixes)}: is left out of the labels")
        stated = [label.split(":", 1)[-1].strip() for label in stated]
    labels, used = list[str](), set[str]()
    for index in range(count):
        plain = (stated[index] if index < len(stated) else "") or "unnamed"
        number = 1
        label = f"{plain}.1" if plain == "unnamed" else plain
        while label in used:
            number += 1
            label = f"{plain}.{number}"
        used.add(label)
        labels.append(label)
    repeated = [label for label, plain in zip(labels, [*stated, *labels], strict=False) if label != plain]
    if repeated:
        notes.append(f"labels repeated or empty, made unique: {_some(repeated)}")
    return labels


def _some(names: list[str]) -> str:
    """The first few names."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def length_factor(unit: str) -> float | None:
    """Metres per unit; names may be cut off ("mete"), None where unknown or empty."""
    plain = unit.strip(" .\0").lower()
    if plain in LENGTHS:
        return LENGTHS[plain]
    full = {LENGTHS[name] for name in LENGTHS if len(plain) >= 2 and name.startswith(plain)}
    return full.pop() if len(full) == 1 else None


def length_unit(name: str, markers: dict[str, Array], parameters: Parameters, notes: list[str]) -> float:
    """Metres per stated unit.  Without a unit the extent of the markers (a body), else of the plates, must allow one only.

    Raises Refused (no_unit).
    """
    unit = " ".join(parameters.text("POINT", "UNITS")[:1])
    factor = length_factor(unit)
    if factor is not None:
        return factor
    extent, (low, high), what = _extent(markers, parameters)
    allowed = [(text, LENGTHS[text]) for text in ("mm", "cm", "m") if low <= extent * LENGTHS[text] <= high]
    if len(allowed) != 1:
        message = f"{name}: POINT:UNITS is {unit!r} and {what} {extent:.4g} units, which tells no unit"
        raise Refused("no_unit", message, "state mm or m in POINT:UNITS when exporting")
    notes.append(f"POINT:UNITS is {unit!r}: taken as {allowed[0][0]}, because {what} {extent:.4g} units")
    return allowed[0][1]


def _extent(markers: dict[str, Array], parameters: Parameters) -> tuple[float, tuple[float, float], str]:
    """Largest extent in stated units, the range it must have in m, and what was measured."""
    corners = parameters.array("FORCE_PLATFORM", "CORNERS")
    if len(markers) > 2:
        stack = np.stack([*markers.values()], axis=1)
        stack = stack[np.isfinite(stack).any(axis=(1, 2))]
        spans = np.nanmax(stack, axis=1) - np.nanmin(stack, axis=1)
        return float(np.median(spans.max(axis=1))), BODY, "the markers span"
    if corners.ndim == 3 and corners.size:
        sides = np.linalg.norm(np.diff(corners, axis=1), axis=0)
        return float(sides.max()), PLATE, "the plates' longest side is"
    return float("nan"), BODY, "the markers span"
