"""What the pipeline's axes are in the lab's: vertical from gravity, lateral from left and right, both snapped to lab axes.

Pipeline: x to the subject's right, y forward, z up; x cross y = z. A map is a matrix R of 0, 1, -1 with determinant +1, one row
per pipeline axis: v_pipeline = R v_lab.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from plumbline.errors import PlumblineError
from plumbline.readers.raw import Array, RawPlate

NAMES = "XYZ"
OBLIQUE = 20.0  # [deg] a subject turned further than this from the lab axes is named in the notes


class Axes(NamedTuple):
    """The map and how it was found.  matrix: shape (3, 3).  text: e.g. "x=+Z y=+X z=+Y".  origin: config, or in words."""

    matrix: Array
    text: str
    origin: str
    notes: list[str]


def configured(axes: Mapping[str, str]) -> Axes:
    """The map that the config states, e.g. {x: +Z, y: +X, z: +Y}.

    Raises PlumblineError where an axis is named twice or the three are left-handed.
    """
    matrix = np.array([_unit(axes[a]) for a in "xyz"])
    text = " ".join(f"{a}: {axes[a]}" for a in "xyz")
    if abs(np.linalg.det(matrix)) < 0.5:
        raise PlumblineError(f"axes: {{{text}}} in config.yaml names one lab axis twice; each of X, Y, Z stands once")
    if np.linalg.det(matrix) < 0:
        raise PlumblineError(
            f"axes: {{{text}}} in config.yaml is left-handed (x right, y forward, z up need x cross y = z); change one sign"
        )
    return Axes(matrix, said(matrix), "config", [])


def _unit(name: str) -> Array:
    return _along(NAMES.index(name[-1].upper()), -1.0 if name.startswith("-") else 1.0)


def _along(axis: int, sign: float) -> Array:
    """Signed lab axis, shape (3,)."""
    out = np.zeros(3)
    out[axis] = sign
    return out


def said(matrix: Array) -> str:
    """The map in words: x=+Z y=+X z=+Y."""
    return " ".join(f"{a}={axis_name(row)}" for a, row in zip("xyz", matrix, strict=True))


def axis_name(axis: Array) -> str:
    """A signed lab axis in words, e.g. +Z.  axis: shape (3,), one entry of 1 or -1."""
    return f"{'+' if axis.sum() > 0 else '-'}{NAMES[int(np.argmax(np.abs(axis)))]}"


def turned(values: Array, matrix: Array) -> Array:
    """Vectors in the pipeline's axes, shape (..., 3); a missing component stays in its own axis."""
    source = np.argmax(np.abs(matrix), axis=1)
    return np.asarray(values[..., source] * matrix[np.arange(3), source])


def find(points: Array, labels: list[str], plates: list[RawPlate]) -> Axes:
    """Find the map from one recording.

    points: markers [m], shape (n, m, 3), lab axes.  plates: those that carry a load.
    """
    notes: list[str] = []
    up, up_from = _vertical(points, labels, plates, notes)
    right, right_from = _lateral(points, labels, plates, up, notes)
    matrix = np.array([right, np.cross(up, right), up])
    return Axes(matrix, said(matrix), f"vertical from {up_from}; lateral from {right_from}", notes)


def mean_load(plate: RawPlate) -> Array:
    """Mean recorded force over the samples above half of the largest [N], shape (3,)."""
    force = np.nan_to_num(plate.force)
    size = np.linalg.norm(force, axis=1)
    return np.asarray(force[size >= 0.5 * size.max()].mean(axis=0))


# -- vertical ---------------------------------------------------------------------------------------------------------


def _vertical(points: Array, labels: list[str], plates: list[RawPlate], notes: list[str]) -> tuple[Array, str]:
    """Signed lab axis that points up, shape (3,), and what it was found from."""
    if plates:
        load = np.sum([np.abs(mean_load(p)) for p in plates], axis=0)
        axis = int(np.argmax(load))
        if load[axis] < 3.0 * np.delete(load, axis).max():
            notes.append(
                f"the force (X, Y, Z: {load[0]:.0f}, {load[1]:.0f}, {load[2]:.0f} N) is far from any lab axis; state `axes:` in the config"
            )
        ground = float(np.median([_height(p, axis) for p in plates]))
        return _upward(axis, points, ground, notes), "gravity"
    middle = np.nanmedian(points, axis=0) if points.shape[1] else np.empty((0, 3))
    low = np.array([bool(_FOOT.search(label)) for label in labels], dtype=bool)
    if low.any() and not low.all():
        rise = np.nanmean(middle[~low], axis=0) - np.nanmean(middle[low], axis=0)
        axis = int(np.argmax(np.abs(rise)))
        return _along(axis, float(np.sign(rise[axis]))), "the markers (feet below the others)"
    axis = int(np.argmax(np.nanmax(middle, axis=0) - np.nanmin(middle, axis=0))) if len(middle) > 1 else 2
    notes.append(f"no plate and no foot marker says which way is up; +{NAMES[axis]} is assumed")
    return _along(axis, 1.0), "the extent of the markers"


def _height(plate: RawPlate, axis: int) -> float:
    """Coordinate of a plate's surface along a lab axis [m]."""
    return float(np.mean(plate.corners[:, axis])) if plate.corners is not None else float(plate.origin[axis])


def _upward(axis: int, points: Array, ground: float, notes: list[str]) -> Array:
    """The lab axis with the sign that puts the markers above the plates."""
    if points.shape[1]:
        return _along(axis, 1.0 if np.nanmedian(points[..., axis]) >= ground else -1.0)
    notes.append(f"no marker says which way is up; +{NAMES[axis]} is assumed")
    return _along(axis, 1.0)


_FOOT = re.compile(r"toe|heel|hee|ank|mal|calc|cal$|foot|meta|mt\d|mh\d|fcc|fm\d|fal|tam|lfc", re.IGNORECASE)

# -- lateral ----------------------------------------------------------------------------------------------------------


def _lateral(points: Array, labels: list[str], plates: list[RawPlate], up: Array, notes: list[str]) -> tuple[Array, str]:
    """Signed lab axis to the subject's right, shape (3,), and what it was found from."""
    flat = 1.0 - np.abs(up)
    ways = _pair_directions(points, labels) * flat
    length = np.linalg.norm(ways, axis=1, keepdims=True)
    ways = (ways / np.where(length > 0, length, 1.0))[length[:, 0] > 0.01]
    if len(ways):
        return _snap(ways.mean(axis=0), notes), f"{len(ways)} pairs of left and right markers"
    feet = {p.foot: p for p in plates if p.foot}
    if len(feet) == 2 and _together(list(feet.values())):
        return _snap((_place(feet["right"], up) - _place(feet["left"], up)) * flat, notes), "the plates of the left and the right foot"
    if len(plates) == 2 and _together(plates):
        apart = _snap((_place(plates[1], up) - _place(plates[0], up)) * flat, notes)
        right = apart * np.sign(apart.sum())
        notes.append(f"no left and right marker: the two plates lie side by side along {axis_name(right)}, taken as the subject's right")
        return right, "the line between two plates (its sign is assumed)"
    right = np.roll(np.abs(up), 1) * np.sign(up.sum())
    notes.append(f"nothing says what is left and right: {axis_name(right)} is assumed to be the right; state `axes:` in the config")
    return right, "nothing (assumed)"


def _snap(way: Array, notes: list[str]) -> Array:
    axis = int(np.argmax(np.abs(way)))
    size = float(np.linalg.norm(way))
    angle = float(np.degrees(np.arccos(np.clip(abs(way[axis]) / size, 0.0, 1.0)))) if size else 0.0
    if angle > OBLIQUE:
        notes.append(f"the subject's left-right line is {angle:.0f} degrees off the lab axis {NAMES[axis]} that stands for it")
    return _along(axis, float(np.sign(way[axis])))


def _pair_directions(points: Array, labels: list[str]) -> Array:
    """Mean vector from each left marker to its right twin [m], shape (pairs, 3); only frames where both are seen."""
    twins = pairs(labels)
    with np.errstate(invalid="ignore"):
        apart = [points[:, right] - points[:, left] for left, right in twins]
    seen = [a[np.isfinite(a).all(axis=1)] for a in apart]
    return np.array([a.mean(axis=0) for a in seen if len(a)]).reshape(-1, 3)


def pairs(labels: list[str]) -> list[tuple[int, int]]:
    """Indices of left markers and their right twins, by name: LASI RASI, L.Heel R.Heel, left_toe right_toe, calcn_l calcn_r."""
    sides: dict[str, dict[str, int]] = {}
    for i, label in enumerate(labels):
        side, stem = side_of(label)
        if side:
            sides.setdefault(stem, {})[side] = i
    return [(s["left"], s["right"]) for s in sides.values() if len(s) == 2]


_WORD = re.compile(r"left|right", re.IGNORECASE)
_TOKEN = re.compile(r"(?:^|(?<=[\s._\-]))([lr])(?=$|[\s._\-\d])", re.IGNORECASE)
_FIRST = re.compile(r"^(?:([LR])(?=\w)|([lr])(?=[A-Z]))")
_LAST = re.compile(r"(?<=[a-z\d])([LR])$")


def side_of(label: str) -> tuple[str, str]:
    """Side ("left", "right" or "") that a label says, and the label without it; a prefix `subject:` is ignored."""
    plain = label.rsplit(":", 1)[-1]
    for pattern in (_WORD, _TOKEN, _FIRST, _LAST):
        match = pattern.search(plain)
        if match:
            side = "left" if match.group(0)[0] in "lL" else "right"
            return side, f"{plain[: match.start()]}*{plain[match.end() :]}".lower()
    return "", plain.lower()


def _place(plate: RawPlate, up: Array) -> Array:
    """Mean place of the load on a plate [m], shape (3,): CoP of the mean wrench, surface height not minded."""
    force, moment = np.nan_to_num(plate.force), np.nan_to_num(plate.moment)
    load = force @ up
    on = np.abs(load) >= 0.5 * np.abs(load).max()
    return np.asarray(plate.origin + np.cross(up, moment[on].mean(axis=0)) / load[on].mean())


def _together(plates: list[RawPlate]) -> bool:
    """Whether both plates are loaded during most of the time that either is: standing, not steps one after the other."""
    loads = [np.linalg.norm(np.nan_to_num(p.force), axis=1) for p in plates]
    if loads[0].size != loads[1].size:
        return False
    a, b = (x > 0.2 * x.max() for x in loads)
    return bool((a & b).sum() > 0.8 * (a | b).sum())
