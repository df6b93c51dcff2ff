"""Loads of the force plates: which carry a person, the sign that makes them a reaction, CoP, body mass, and whose foot it is.

Everything here is in the pipeline's axes (x right, y forward, z up), SI, unless a docstring says lab axes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from plumbline.axes import turned
from plumbline.errors import Refused
from plumbline.physics import G
from plumbline.readers.raw import Array, RawPlate

LOADED = 80.0  # [N] a plate that never carries more is unloaded: offsets up to 48 N were seen, half a child weighs 100 N
COP_FORCE = 20.0  # [N] no CoP below this or 3 % of the largest load
STANDING = 0.6  # [m] a net CoP that travels further is no standing
STEADY = 0.4  # [1] 10th to 90th percentile of the load over its median, up to which it is standing
CLEAR = 0.3  # [1] least correlation that decides the sign of the shear
NO_FOOT = "none"  # what a plate says that is a handle or a seat: it counts however light, and lies at no floor's height


@dataclass
class Plate:
    """One force plate: ground reaction on the person.

    number: from 1, in the file's order.  time: [s], shape (k,).  force: [N], shape (k, 3), NaN where not recorded.
    moment: about the coordinates' origin [N m], shape (k, 3), kept however small the load; NaN where a load has no valid CoP.
    cop: on the plate's surface [m], shape (k, 3), NaN while unloaded.  free_moment: vertical, about the CoP [N m], shape (k,).
    corners: [m], shape (4, 3), or None.  foot: "left", "right", "none" (a handle, a seat) or "".
    """

    number: int
    time: Array
    force: Array
    moment: Array
    cop: Array
    free_moment: Array
    corners: Array | None = None
    foot: str = ""


# -- lab axes: who is loaded ------------------------------------------------------------------------------------------


def usable(plates: list[RawPlate], task: str, notes: list[str]) -> dict[int, RawPlate]:
    """Plates that carry a load, by number from 1 (lab axes); on task `empty` every plate, loaded or not.

    Raises Refused(unloaded) where none is loaded, Refused(stuck_channel) where a channel of a loaded plate does not move.
    """
    loaded = {i: p for i, p in enumerate(plates, 1) if _peak(p) > (0.0 if p.foot == NO_FOOT else LOADED)}
    idle = [f"plate {i} ({_offset(p):+.0f} N)" for i, p in enumerate(plates, 1) if i not in loaded]
    if task == "empty":
        return dict(enumerate(plates, 1))
    if not floor(list(loaded.values())):
        raise Refused(
            "unloaded",
            f"nobody stands on the plates: {', '.join(idle)}",
            "use a trial with a person on them, or name its task `empty`",
        )
    if idle:
        notes.append(f"left out, without a load: {', '.join(idle)}")
    for i, plate in loaded.items():
        _check_moving(i, plate)
    return {i: _without_blank_shear(i, p, notes) for i, p in loaded.items()}


def _size(plate: RawPlate) -> Array:
    return np.asarray(np.linalg.norm(np.nan_to_num(plate.force), axis=1))


def _peak(plate: RawPlate) -> float:
    """Force that is exceeded for 50 ms in all [N]; single spikes do not load a plate."""
    size = _size(plate)
    if not size.size:
        return 0.0
    step = float(np.median(np.diff(plate.time))) if size.size > 1 else 0.0
    k = min(size.size, 1 + int(0.05 / step) if step > 0 else 1)
    return float(np.partition(size, size.size - k)[size.size - k])


def _offset(plate: RawPlate) -> float:
    """Mean of the largest component [N]."""
    mean = np.nanmean(np.nan_to_num(plate.force), axis=0)
    return float(mean[np.argmax(np.abs(mean))])


def _check_moving(number: int, plate: RawPlate) -> None:
    stuck = [n.removeprefix("stuck:").strip() for n in plate.notes if n.startswith("stuck:")]
    for axis, column in zip("xyz", plate.force.T, strict=True):
        value = column[np.isfinite(column)]
        if value.size > 10 and value[0] != 0.0 and (value == value[0]).all():
            stuck.append(f"force {axis} = {value[0]:g} N")
    if stuck:
        raise Refused(
            "stuck_channel",
            f"plate {number}: does not move over the whole trial: {', '.join(stuck)}",
            "check the cable and record again; noise-free simulations look the same: add sensor noise",
        )


def _without_blank_shear(number: int, plate: RawPlate, notes: list[str]) -> RawPlate:
    """Force components that are exactly zero all through were not recorded: NaN, with a note."""
    blank = (plate.force == 0.0).all(axis=0)
    if not blank.any():
        return plate
    notes.append(f"plate {number}: lab {', '.join('XYZ'[i] for i in np.flatnonzero(blank))} force is always zero: taken as not recorded")
    return replace(plate, force=np.where(blank, np.nan, plate.force))


# -- reaction and CoP -------------------------------------------------------------------------------------------------


def reaction(number: int, raw: RawPlate, matrix: Array, sign: float | None = None) -> tuple[Plate, float]:
    """One plate in the pipeline's axes with the sign that makes its vertical force a reaction, and that sign (+1 or -1).

    raw: lab axes.  matrix: pipeline from lab, shape (3, 3).  sign: stated; None: found.
    Force and moment change sign together, so the CoP does not depend on it. A light load whose place the file does not tell is
    put at the plate's origin: 20 N there are nearer to the truth than none.
    """
    force, moment, origin = turned(raw.force, matrix), turned(raw.moment, matrix), turned(raw.origin, matrix)
    corners = None if raw.corners is None else turned(raw.corners, matrix)
    up = np.nan_to_num(force[:, 2])
    on = np.abs(up) >= 0.5 * np.abs(up).max()
    if sign is None:
        sign = -1.0 if np.median(up[on]) < 0 else 1.0
    force, moment = sign * force, sign * moment
    moment[np.isnan(moment).any(axis=1) & (np.abs(up) < COP_FORCE)] = 0.0
    height = float(np.mean(corners[:, 2])) if corners is not None else float(origin[2])
    cop, free = centre(force, moment, origin, height)
    moment = moment + np.cross(origin, np.nan_to_num(force))
    moment[np.isnan(force[:, 2])] = np.nan
    return Plate(number, raw.time, force, moment, cop, free, corners, raw.foot), sign


def centre(force: Array, moment: Array, origin: Array, surface: float) -> tuple[Array, Array]:
    """CoP in the plane z = surface and free vertical moment from a wrench.

    With d = p - origin: M_x = d_y F_z - d_z F_y, M_y = d_z F_x - d_x F_z, T = M_z - (d_x F_y - d_y F_x).
    force, moment about `origin`: shape (k, 3).  Shear that is not recorded counts as none.  No threshold here: see `drop_light`.
    """
    fx, fy, fz = np.nan_to_num(force).T
    dz = surface - origin[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        dx = (dz * fx - moment[:, 1]) / fz
        dy = (dz * fy + moment[:, 0]) / fz
        free = moment[:, 2] - (dx * fy - dy * fx)
    return np.column_stack([origin[0] + dx, origin[1] + dy, np.full(fz.size, surface)]), free


def light_below(forces: Iterable[Array]) -> float:
    """Vertical load [N] below which a plate has no CoP: 20 N, or 3 % of the largest load on any.  forces: each (k, 3)."""
    return max([COP_FORCE, *(0.03 * float(np.nanmax(f[:, 2])) for f in forces if np.isfinite(f[:, 2]).any())])


def turn_shear(plate: Plate) -> None:
    """Give the shear and the free moment the other sign; the CoP stays where it is (in place)."""
    shear = np.nan_to_num(plate.force[:, :2])
    plate.moment += 2.0 * surface([plate.cop]) * np.column_stack([shear[:, 1], -shear[:, 0], 0.0 * shear[:, 0]])
    plate.moment[:, 2] *= -1.0
    plate.force[:, :2] *= -1.0
    plate.free_moment *= -1.0


def drop_light(plates: list[Plate]) -> None:
    """CoP and free moment become NaN while a plate is light (in place); force and moment stay what they are."""
    least = light_below(p.force for p in plates)
    for plate in plates:
        light = ~(plate.force[:, 2] >= least)
        plate.cop[light], plate.free_moment[light] = np.nan, np.nan


# -- all plates together ----------------------------------------------------------------------------------------------


class Carrier(Protocol):
    """What says which foot it carries."""

    foot: str


P = TypeVar("P", bound=Carrier)


def floor(plates: Sequence[P]) -> list[P]:
    """Plates that feet can stand on: not a handle, not a seat."""
    return [p for p in plates if p.foot != NO_FOOT]


def surface(cops: Iterable[Array]) -> float:
    """Height of several plates together [m]: mean of the median heights of their CoP (k, 3); NaN without any."""
    heights = [float(np.nanmedian(cop[:, 2])) for cop in cops if np.isfinite(cop[:, 2]).any()]
    return float(np.mean(heights)) if heights else float("nan")


def total(plates: list[Plate]) -> tuple[Array, Array, Array]:
    """Time, net force (k, 3) and net CoP (k, 2) of plates with forces, on the time of the first; NaN shear stays NaN."""
    time = plates[0].time
    at = partial(_at, time)
    force = np.sum([at(p.time, p.force) for p in plates], axis=0)
    moment = np.sum([at(p.time, p.moment) for p in plates], axis=0)
    cop, _ = centre(force, moment, np.zeros(3), surface(p.cop for p in floor(plates)))
    return time, force, cop[:, :2]


def _at(at: Array, time: Array, values: Array) -> Array:
    if time.size == at.size and np.allclose(time, at):
        return values
    return np.column_stack([np.interp(at, time, c) for c in values.T])


@dataclass(frozen=True)
class Standing:
    """What standing shows.  mass: [kg], NaN where the load is not steady.  shear: +1, -1, NaN without shear.  notes: in words."""

    mass: float
    shear: float
    notes: list[str]


def standing(plates: list[Plate], climb: float = 0.0) -> Standing:
    """Body mass and the sign of the shear, where somebody stands on the plates all the time.

    climb: mean vertical acceleration of the body over the recording, from its markers [m/s2]; not 0 where a trial ends in motion.
    The load counts as steady where it stays above half of its median and 80 N for 80 % of the time, its 10th and 90th percentiles
    lie within 40 % of the median (slow squats do, gait over ground does not) and the CoP stays within 0.6 m.
    """
    time, force, cop = total(plates)
    up = np.nan_to_num(force[:, 2])
    on = up > LOADED
    on &= up > 0.5 * np.median(up[on]) if on.any() else on  # getting on and off is no standing
    low, middle, high = np.percentile(up[on], [10, 50, 90]) if on.any() else np.full(3, np.nan)
    stays, spread = bool(on.mean() > 0.8), (high - low) / middle
    travel = float(np.ptp(np.nanpercentile(cop[on], [1, 99], axis=0), axis=0).max()) if stays else np.inf
    mass = _mass(up, on, climb) if stays and spread < STEADY and travel < STANDING else float("nan")
    if not (np.isfinite(force[:, :2]).mean(axis=0) > 0.5).any():
        return Standing(mass, float("nan"), ["no shear force is recorded: the CoM cannot be had from the forces"])
    if not stays or spread > 1.5 * STEADY or travel > STANDING or _take_turns(floor(plates)):
        return Standing(mass, 1.0, ["moving on the plates does not show the sign of the shear; taken as the vertical force's"])
    sign, note = shear_sign(time, force, cop)
    return Standing(mass, sign, [note])


def _mass(up: Array, on: NDArray[np.bool_], climb: float) -> float:
    """Mass [kg] from the net vertical force.

    m (G + mean acceleration) is the mean force, whatever the movement; the median is off by 1.5 % in squats. Where the person gets
    on or off the plates meanwhile, the median is what is left.
    """
    return float(up.mean() / (G + climb)) if on.mean() > 0.995 else float(np.median(up[on]) / G)


def _take_turns(plates: list[Plate]) -> bool:
    """Whether a plate is without load for a fifth of the time: stepping or walking, in which the CoP moves with the feet."""
    return any(np.isfinite(p.cop[:, 0]).mean() < 0.8 for p in plates)


def shear_sign(time: Array, force: Array, cop: Array) -> tuple[float, str]:
    r"""Factor (+1, -1) that makes the shear a reaction on the person, and how it was found.

    With :math:`\ddot x = \omega^2 (x - p)`, :math:`F_x = m \ddot x` and a sway at :math:`\Omega`, where
    :math:`x = -\ddot x / \Omega^2`, the CoP is :math:`p = x - \ddot x / \omega^2 = -(F_x / m)(1/\Omega^2 + 1/\omega^2)`:
    CoP and reaction are in antiphase at every frequency.
    The correlation between 0.5 and 2 Hz decides where it is clear on either horizontal axis.
    force: shape (k, 3).  cop: shape (k, 2).
    """
    rate = (time.size - 1) / (time[-1] - time[0])
    if time[-1] - time[0] < 4.0 or rate < 5.0:
        return 1.0, "too short to see the sign of the shear; taken as the vertical force's"
    sos = butter(2, [0.5, 2.0], btype="bandpass", fs=rate, output="sos")
    r = np.array([_correlation(sos, force[:, a], cop[:, a]) for a in (0, 1)])
    best = r[np.nanargmax(np.abs(r))] if np.isfinite(r).any() else 0.0
    values = f"correlation of CoP and shear between 0.5 and 2 Hz: x {r[0]:.2f}, y {r[1]:.2f}"
    if abs(best) < CLEAR:
        return 1.0, f"{values}; too weak to tell the sign of the shear, taken as the vertical force's"
    if np.nanmin(np.abs(r)) > CLEAR and r[0] * r[1] < 0:
        return (
            1.0,
            f"{values}; they disagree: one column has a wrong sign, or the axes are left-handed; kept as recorded",
        )
    return (1.0, f"{values}: the shear is a reaction") if best < 0 else (-1.0, f"{values}: the shear has the other sign and is turned")


def _correlation(sos: Array, force: Array, cop: Array) -> float:
    ok = np.isfinite(force) & np.isfinite(cop)
    if ok.mean() < 0.95:
        return float("nan")
    index = np.arange(ok.size)
    a, b = (sosfiltfilt(sos, np.interp(index, index[ok], v[ok]) - v[ok].mean()) for v in (force, cop))
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return float(a @ b / size) if size > 0 else float("nan")
