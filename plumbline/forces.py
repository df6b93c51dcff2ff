r"""Forces at the frames' times: net ground reaction, CoP of each foot and ZMP, without a shift in time.

Plates are usually faster than cameras. Each frame gets the average of the plate's linear interpolant over one frame's width
*centred on the frame's time* (weights of a trapezoid, symmetric, hence without phase); slower or equally fast plates are
interpolated. At the ends of the force record the window shrinks on both sides alike; outside of it the values are NaN. Forces and
moments are averaged, the plates' wrenches are added, however small, and the CoP is formed from the sum: leaving out 8 of 700 N
under a light foot would move the ZMP by 3 mm. Only a plate that stands empty counts as zero (``plumbline/contact.py``); a handle or a
seat always counts, and says nothing of the floor's height.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from plumbline import contact
from plumbline.contact import Foot
from plumbline.filters import known
from plumbline.loads import LOADED, NO_FOOT, floor, light_below, surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_LOAD = 20.0  # [N] vertical load below which a centre of pressure means nothing
ZERO = 1e-6  # [N], [N m] averages leave 1e-14 of zeros
ABOVE = 0.05  # [m] above the floor, from which on a sensor's place is told; moments about a point of the floor do not tell it
MIN_RATIO = 1.5  # [1] plate samples per frame from which on they are averaged


class Plate(Protocol):
    """A force plate in pipeline axes, as :class:`plumbline.loads.Plate`: reaction [N], its moment about the origin [N m], CoP [m]."""

    number: int
    time: Array
    force: Array
    moment: Array
    cop: Array
    free_moment: Array
    corners: Array | None
    foot: str


@dataclass
class Forces:
    """Forces at the n frames: grf [N], zmp [m] (net and per foot), each (n, 3), NaN where unknown or unloaded.

    surface: height of the plates [m], NaN without plates.  feet: "left"/"right" -> (grf, cop).  hand: where handles and seats bear
    [m], (n, 3), while nothing is on them where that was or will be; NaN without any whose height is told.  notes: words.
    """

    grf: Array
    zmp: Array
    surface: float
    feet: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    hand: Array = field(default_factory=lambda: np.zeros((0, 3)))
    notes: list[str] = field(default_factory=list)


def box_weights(width: float) -> Array:
    """Weights of the average of a linear interpolant over `width` samples centred on a sample; symmetric, they sum to 1."""
    half = int(np.ceil(width / 2.0))
    j = np.arange(-half, half + 1, dtype=float)

    return (_hat_integral(width / 2.0 - j) - _hat_integral(-width / 2.0 - j)) / width


def _hat_integral(t: Array) -> Array:
    """Integral of max(0, 1 - |t|) from the left."""
    s = np.clip(t, -1.0, 1.0)
    return np.where(s < 0, 0.5 * (1.0 + s) ** 2, 1.0 - 0.5 * (1.0 - s) ** 2)


def at_frames(values: Array, time: Array, frames: Array) -> Array:
    """Bring samples to the frames' times without phase (see module).

    values: (k, d), finite.  time: (k,) [s].  frames: (n,) [s].  Returns (n, d); NaN outside the record.
    """
    out = np.full((len(frames), values.shape[1]), np.nan)
    if len(time) < 2 or not len(frames):
        return out
    step = float(np.median(np.diff(time)))
    ratio = float(np.median(np.diff(frames))) / step if len(frames) > 1 else 1.0
    smooth = _averaged(values, ratio) if ratio >= MIN_RATIO else values
    inside = (frames >= time[0] - 1e-6) & (frames <= time[-1] + 1e-6)
    for k in range(values.shape[1]):
        out[inside, k] = np.interp(frames[inside], time, smooth[:, k])
    return out


def _averaged(values: Array, ratio: float) -> Array:
    """Average over `ratio` samples around each sample; the window shrinks symmetrically at both ends."""
    weights = box_weights(ratio)
    half, n = len(weights) // 2, len(values)
    out = np.array(values, dtype=float)
    if n > 2 * half:
        centre = values.mean(axis=0)
        out[half : n - half] = oaconvolve(values - centre, weights[:, None], mode="valid", axes=0) + centre
    for i in range(1, min(half, (n + 1) // 2)):
        w = box_weights(min(ratio, 2.0 * i))
        r = len(w) // 2
        out[i] = w @ values[i - r : i + r + 1]
        out[n - 1 - i] = w @ values[n - 1 - i - r : n - i + r]
    return out


def net(plates: Sequence[Plate], frames: Array, feet: Mapping[str, Foot] = MappingProxyType({})) -> Forces:
    """Net and per-foot forces at the frames' times [s], shape (n,): sums of the plates' wrenches, empty plates as zero.

    feet: side -> a foot's markers at the frames; without them an empty plate is told by its load (``plumbline/contact.py``).
    """
    n = len(frames)
    used = [p for p in plates if len(p.time) > 1 and (p.foot == NO_FOOT or _carries(p))]
    out = Forces(np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.nan, hand=np.full((n, 3), np.nan))
    if not used:
        return out
    out.surface = surface(p.cop for p in floor(used))
    if not any(np.isfinite(p.force[:, 2]).any() for p in used):
        out.zmp = _cop_only(used, frames, out.notes)
        return out
    least = light_below(p.force for p in used)
    wrenches = [_loads(p, frames, least, feet, out.notes) for p in used]
    out.grf, out.zmp = _sum(wrenches, used)
    held = [p for p in used if p.foot == NO_FOOT and surface([p.cop]) - np.nan_to_num(out.surface) > ABOVE]
    if held:
        out.hand = np.mean([_place(p, frames) for p in held], axis=0)
    for side in ("left", "right"):
        mine = [i for i, p in enumerate(used) if p.foot == side]
        if mine:
            out.feet[side] = _sum([wrenches[i] for i in mine], [used[i] for i in mine])
    return out


def _carries(plate: Plate) -> bool:
    return bool(known(plate.cop).any() or np.nanmax(plate.force[:, 2], initial=0.0) > LOADED)


def _sum(wrenches: Sequence[Array], plates: Sequence[Plate]) -> tuple[Array, Array]:
    """Force [N] and CoP [m] of several plates together, (n, 3) each; a force component that one lacks is NaN."""
    total = np.sum(wrenches, axis=0)
    force = total[:, :3].copy()
    force[:, [bool(any(np.isnan(p.force[:, k]).all() for p in plates)) for k in range(3)]] = np.nan
    return force, _cop(total, surface(p.cop for p in floor(plates)))


def _place(plate: Plate, frames: Array) -> Array:
    """Where a handle or a seat bears at the frames [m], (n, 3)."""
    seen = known(plate.cop)
    return np.column_stack([np.interp(frames, plate.time[seen], plate.cop[seen, k]) for k in range(3)])


def _loads(plate: Plate, frames: Array, least: float, feet: Mapping[str, Foot], notes: list[str]) -> Array:
    """Wrench of one plate at the frames (n, 6), zero where the plate is empty; what was taken as empty goes to `notes`."""
    wrench = wrench_at(plate, frames)
    lost = int((np.isnan(plate.moment).any(axis=1) & (plate.force[:, 2] >= least)).sum())
    if lost:
        notes.append(f"plate {plate.number}: loaded without a CoP in {lost} samples: no ZMP there")
    if plate.foot == NO_FOOT:
        return wrench
    load = wrench[:, 2]
    light = load < least
    standing = [feet[plate.foot]] if plate.foot in feet else list(feet.values()) if len(feet) == 2 else []
    empty = contact.empty(load, light, standing, contact.area(plate.corners, plate.cop), frames)
    reads = load[empty & (np.abs(wrench).max(axis=1) > ZERO)]
    if reads.size:
        why = "no foot is on it" if standing else "it reads the same, steady, at an end of the file"
        notes.append(
            f"plate {plate.number}: taken as empty in {reads.size} of {len(frames)} frames ({why}); mean {reads.mean():+.1f} N there"
        )
    kept = int((light & ~empty & (np.abs(load) > ZERO)).sum())
    if kept and not standing:
        notes.append(f"plate {plate.number}: light in {kept} of {len(frames)} frames, as a foot or as a zero error; counted as load")
    wrench[empty] = 0.0
    return wrench


def wrench_at(plate: Plate, frames: Array) -> Array:
    """Force [N] and moment about the origin [N m] of one plate at the frames, (n, 6).

    Shear that is not recorded counts as none. Other missing samples make the frames they reach NaN.
    """
    wrench = np.hstack([plate.force, plate.moment])
    wrench[:, :3][:, np.asarray(np.isnan(plate.force).all(axis=0))] = 0.0
    gone = np.isnan(wrench)
    out = at_frames(np.hstack([np.where(gone, 0.0, wrench), gone]), plate.time, frames)
    values, touched = out[:, :6], out[:, 6:] > 1e-6  # the convolution leaves 1e-17 elsewhere
    values[touched] = np.nan
    return values


def _cop(wrench: Array, height: float) -> Array:
    """Point of the plane z = height where the wrench has no horizontal moment [m], (n, 3); NaN below `MIN_LOAD`."""
    fx, fy, fz, mx, my = wrench[:, :5].T
    load = np.where(fz > MIN_LOAD, fz, np.nan)
    x, y = (height * fx - my) / load, (height * fy + mx) / load
    return np.column_stack([x, y, np.where(np.isfinite(x + y), height, np.nan)])


def _cop_only(plates: Sequence[Plate], frames: Array, notes: list[str]) -> Array:
    """CoP of a recording without forces, [m], (n, 3): of its only plate."""
    if len(plates) > 1:
        notes.append(f"{len(plates)} centres of pressure without forces: no net one can be formed")
        return np.full((len(frames), 3), np.nan)
    good = known(plates[0].cop)
    return at_frames(plates[0].cop[good], plates[0].time[good], frames)
