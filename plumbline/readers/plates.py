r"""Force plates of a C3D, types 1 to 4, as force and moment about the centre of the plate's surface, in lab axes.

Source: the C3D file format user guide (c3d.org), FORCE_PLATFORM. The plate's axes follow from its corners, numbered 1 to 4
from the quadrant +x +y over -x +y: x = c1 + c4 - c2 - c3, y = c1 + c2 - c3 - c4, z = x cross y (into the floor).
ORIGIN o points from the sensors' reference point to the centre of the surface, so that M_centre = M - o cross F.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.readers.layout import Array, Parameters
from plumbline.readers.raw import RawPlate

NEEDS = {1: 6, 2: 6, 3: 8, 4: 6}  # channels of each plate type
FORCES = {
    "n": 1.0,
    "nt": 1.0,
    "newton": 1.0,
    "newtons": 1.0,
    "kn": 1e3,
    "lb": 4.4482216,
    "lbf": 4.4482216,
    "lbs": 4.4482216,
}
MOMENTS = {"m": 1.0, "meter": 1.0, "meters": 1.0, "metre": 1.0, "mm": 1e-3, "cm": 1e-2}
LOADED = 50.0  # [N] a plate that never carries more is unloaded
HEAVY = 5000.0  # [N] a single person seldom exceeds it, even landing from a jump
MARGIN = 0.05  # [m] a centre of pressure may lie that far beyond the corners


class Channels(NamedTuple):
    """Scaled analog samples, shape (k, channels), their labels, units and time [s]; samples per frame."""

    values: Array
    labels: list[str]
    units: list[str]
    time: Array
    per_frame: int


class _Plate(NamedTuple):
    """What the parameters say of one plate.  corners: [m], (4, 3).  axes: columns x, y, z in the lab.  origin: [m], (3,)."""

    number: int
    kind: int
    corners: Array
    axes: Array
    origin: Array
    matrix: Array
    columns: NDArray[np.intp]


class _Odd(Exception):
    """One plate cannot form forces; the text says why."""


def read_plates(parameters: Parameters, channels: Channels, length: float, notes: list[str]) -> list[RawPlate]:
    """All plates that can form a wrench; `notes` names the others with the reason.  length: metres per POINT unit."""
    plates = list[RawPlate]()
    for number in range(1, int(parameters.number("FORCE_PLATFORM", "USED")) + 1):
        try:
            plate = _describe(parameters, channels, length, number)
            plates.append(_wrench(plate, parameters, channels, length))
        except _Odd as odd:
            notes.append(f"plate {number} left out: {odd}")
    return plates


def _describe(parameters: Parameters, channels: Channels, length: float, number: int) -> _Plate:
    """Type, corners, axes, origin, calibration and channels of one plate, checked."""
    kinds = parameters.values("FORCE_PLATFORM", "TYPE")
    kind = int(kinds[number - 1]) if len(kinds) >= number else 0
    if kind not in NEEDS:
        raise _Odd(f"type {kind} is not one of 1 to 4" if kind else "FORCE_PLATFORM:TYPE does not name it")
    corners = _entry(parameters, "CORNERS", number, (3, 4)).T * length
    axes = _axes(corners)
    origin = _entry(parameters, "ORIGIN", number, (3,)) * length
    matrix = _entry(parameters, "CAL_MATRIX", number, (6, 6)) if kind == 4 else np.eye(6)
    if not np.any(matrix):
        raise _Odd("type 4 needs CAL_MATRIX, which holds zeros")
    if kind == 3 and not (origin[0] and origin[1]):
        raise _Odd("ORIGIN gives no distance between the sensors, so no moment can be formed")
    return _Plate(number, kind, corners, axes, origin, matrix, _columns(parameters, channels, kinds, number, kind))


def _entry(parameters: Parameters, name: str, number: int, shape: tuple[int, ...]) -> Array:
    """The plate's part, of this shape, of a parameter whose last dimension counts the plates."""
    values = parameters.array("FORCE_PLATFORM", name)
    if values.shape == shape:
        values = values[..., np.newaxis]
    if values.shape[:-1] != shape or values.shape[-1] < number:
        raise _Odd(f"FORCE_PLATFORM:{name} does not hold it")
    return np.asarray(values[..., number - 1], dtype=float)


def _axes(corners: Array) -> Array:
    """Unit axes of the plate as columns (docstring of the module)."""
    c1, c2, c3, c4 = corners
    x, y = c1 + c4 - c2 - c3, c1 + c2 - c3 - c4
    z = np.cross(x, y)
    if not np.isfinite(z).all() or np.linalg.norm(z) < 1e-6:
        raise _Odd("CORNERS span no area")
    y = np.cross(z, x)
    return np.stack([axis / np.linalg.norm(axis) for axis in (x, y, z)], axis=1)


def _columns(parameters: Parameters, channels: Channels, kinds: list[Any], number: int, kind: int) -> NDArray[np.intp]:
    """Columns of the plate's channels.  A table with fewer rows than any plate needs was cut and is shifted for all."""
    table = parameters.array("FORCE_PLATFORM", "CHANNEL")
    if table.ndim == 1:
        table = table[:, np.newaxis]
    rows = max((NEEDS[int(k)] for k in kinds if int(k) in NEEDS), default=0)
    if table.ndim != 2 or table.shape[0] < rows:
        raise _Odd(f"FORCE_PLATFORM:CHANNEL has {table.shape[0]} rows, a plate of this file needs {rows}")
    if table.shape[1] < number:
        raise _Odd("FORCE_PLATFORM:CHANNEL does not hold it")
    index = table[: NEEDS[kind], number - 1].astype(int)
    used = channels.values.shape[1]
    if not len(channels.values):
        raise _Odd("the file holds no analog samples")
    if index.min() < 1 or index.max() > used:
        raise _Odd(f"FORCE_PLATFORM:CHANNEL names channels {index.tolist()}, the file has {used}")
    return (index - 1).astype(np.intp)


def _wrench(plate: _Plate, parameters: Parameters, channels: Channels, length: float) -> RawPlate:
    """Force and moment of one plate about the centre of its surface, with notes on all that was decided."""
    values, notes = channels.values[:, plate.columns], list[str]()
    if len(values) > 1 and (np.ptp(values, axis=0) == 0).all() and values.any():
        raise _Odd(f"all its channels are constant (mean {values.mean():.4g})")
    origin = _origin(plate, notes)
    force, moment = _components(plate, values, channels, length, notes)
    if plate.kind in (2, 4):
        moment *= _moment_unit(plate, channels, force, moment, origin, length, notes)
    if plate.kind != 1:
        moment -= np.cross(origin, force)
        _subtract_baseline(force, moment, parameters, channels.per_frame, notes)
    notes += _stuck(plate, values, channels.labels, force)
    if (peak := np.abs(force).max(initial=0.0)) > HEAVY:
        notes.append(f"reads up to {peak:.0f} N: is ANALOG:SCALE or CAL_MATRIX applied twice?")
    centre = plate.corners.mean(axis=0)
    force, moment = force @ plate.axes.T, moment @ plate.axes.T
    return RawPlate(channels.time, force, moment, centre, plate.corners, f"type-{plate.kind}", notes=notes)


def _origin(plate: _Plate, notes: list[str]) -> Array:
    """Vector from the sensors to the surface, plate axes [m]; z must not be positive, as the plate's z points down."""
    origin = plate.origin.copy()
    if plate.kind == 1:
        return np.zeros(3)
    if plate.kind == 3:
        origin = np.array([0.0, 0.0, origin[2]])
    if origin[2] > 0:
        notes.append(f"ORIGIN has its sign inverted (z = {1e3 * origin[2]:+.1f} mm lies above the surface): turned round")
        origin = -origin
    return origin


def _components(plate: _Plate, values: Array, channels: Channels, length: float, notes: list[str]) -> tuple[Array, Array]:
    """Force [N] and moment (type 1 and 3: N m about the surface or the sensors; 2 and 4: unit not settled), plate axes."""
    newton = 1.0 if plate.kind == 4 else _force_unit(plate, channels, notes)
    v = values.T * 1.0
    if plate.kind == 1:
        fx, fy, fz, px, py, mz = v
        force, x, y = newton * np.stack([fx, fy, fz], axis=1), length * px, length * py
        free = mz * (_moment_factor(_unit(channels, plate.columns[5])) or length)
        turn = np.stack([y * force[:, 2], -x * force[:, 2], free + x * force[:, 1] - y * force[:, 0]], axis=1)
        return force, turn
    if plate.kind == 3:
        return _kistler(newton * v, *np.abs(plate.origin[:2]))
    v = plate.matrix @ v
    return newton * v[:3].T.copy(), v[3:].T.copy()


def _kistler(v: Array, a: float, b: float) -> tuple[Array, Array]:
    """Type 3: eight sensor sums, v = fx12 fx34 fy14 fy23 fz1 fz2 fz3 fz4 [N], sensors at (+-a, +-b) [m]; N and N m."""
    fx12, fx34, fy14, fy23, fz1, fz2, fz3, fz4 = v
    force = np.stack([fx12 + fx34, fy14 + fy23, fz1 + fz2 + fz3 + fz4], axis=1)
    mx, my = b * (fz1 + fz2 - fz3 - fz4), a * (-fz1 + fz2 + fz3 - fz4)
    return force, np.stack([mx, my, b * (-fx12 + fx34) + a * (fy14 - fy23)], axis=1)


def _unit(channels: Channels, column: int) -> str:
    return channels.units[column] if column < len(channels.units) else ""


def _force_unit(plate: _Plate, channels: Channels, notes: list[str]) -> float:
    """Newton per unit of the first channel; an unknown unit reads as newton and is stated."""
    unit = _unit(channels, int(plate.columns[2 if plate.kind < 3 else 4]))
    if unit.lower() not in FORCES:
        notes.append(f"force channels in {unit!r}: taken as N")
    return FORCES.get(unit.lower(), 1.0)


def _moment_factor(unit: str) -> float | None:
    """Newton metre per unit ("Nmm", "ntmm", "N.m", "N-M"); None where the unit is none of a moment."""
    plain = "".join(c for c in unit.lower() if c.isalpha())
    for force in ("newton", "nt", "n"):
        if plain.startswith(force) and plain[len(force) :] in MOMENTS:
            return MOMENTS[plain[len(force) :]]
    return None


def _moment_unit(plate: _Plate, channels: Channels, force: Array, moment: Array, origin: Array, length: float, notes: list[str]) -> float:
    """Newton metre per unit of the moment channels: as stated (N times the POINT unit where not), unless the centre of
    pressure of a loaded plate leaves the plate with that unit and stays on it with another.
    """
    unit = _unit(channels, int(plate.columns[3]))
    stated = _moment_factor(unit) or length
    loaded = np.abs(force[:, 2]) > max(LOADED, 0.3 * np.abs(force[:, 2]).max(initial=0.0))
    if loaded.sum() < 5:
        return stated
    for factor in (
        1.0,
        1e-3,
    ):  # N m first: read as N mm it would keep the pressure within half a millimetre of the centre
        if _on_plate(plate, force[loaded], factor * moment[loaded] - np.cross(origin, force[loaded])) > 0.9:
            if factor != stated:
                name = {1.0: "N m", 1e-3: "N mm"}[factor]
                notes.append(f"moments stated in {unit!r} are in {name}: only so the centre of pressure fits the plate")
            return factor
    return stated


def _on_plate(plate: _Plate, force: Array, moment: Array) -> float:
    """Share of the samples whose centre of pressure lies between the corners."""
    reach = np.abs((plate.corners - plate.corners.mean(axis=0)) @ plate.axes).max(axis=0) + MARGIN
    x, y = -moment[:, 1] / force[:, 2], moment[:, 0] / force[:, 2]
    return float(np.mean((np.abs(x) < reach[0]) & (np.abs(y) < reach[1])))


def _subtract_baseline(force: Array, moment: Array, parameters: Parameters, per_frame: int, notes: list[str]) -> None:
    """Subtract in place the mean over the frames FORCE_PLATFORM:ZERO, which count from the file's first frame as 1.

    Programs write 1 to 10 even where a person stands on the plate from the first frame: a baseline above :data:`LOADED`
    is a load and stays, unless the force later passes zero the other way, which no load does as nobody pulls a plate.
    """
    frames = [int(z) for z in parameters.values("FORCE_PLATFORM", "ZERO")[:2]]
    if len(frames) < 2 or frames[1] < 1 or frames[1] < frames[0]:
        return
    window = slice((max(frames[0], 1) - 1) * per_frame, frames[1] * per_frame)
    if not len(force[window]):
        return
    base = force[window].mean(axis=0)
    words = f"frames {max(frames[0], 1)} to {frames[1]} (ZERO) read {base[2]:+.1f} N along the plate's z"
    other_way = (-np.sign(base[2]) * force[:, 2]).max()
    if abs(base[2]) > LOADED and other_way < LOADED:
        notes.append(f"{words}: a load, not subtracted")
        return
    moment -= moment[window].mean(axis=0)
    force -= base
    notes.append(f"{words}: subtracted as the baseline")


def _stuck(plate: _Plate, values: Array, labels: list[str], force: Array) -> list[str]:
    """Channels of a loaded plate that never move; shear that always reads 0 was not measured and is only stated."""
    if len(values) < 2 or np.abs(force[:, 2]).max() < LOADED:
        return []
    notes = []
    for position in np.flatnonzero(np.ptp(values, axis=0) == 0):
        column = int(plate.columns[position])
        name = labels[column] if column < len(labels) and labels[column] else f"channel {column + 1}"
        shear = position in ((0, 1, 2, 3) if plate.kind == 3 else (0, 1, 5))
        silent = shear and not values[0, position]
        notes.append(f"not measured (always 0): {name}" if silent else f"stuck: {name}")
    return notes
