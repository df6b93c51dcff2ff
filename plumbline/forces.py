r"""Forces at the frames' times: net ground reaction, CoP of each foot and ZMP, without a shift in time.

Plates are usually faster than cameras. Each frame gets the average of the plate's linear interpolant over one frame's width
*centred on the frame's time* (weights of a trapezoid, symmetric, hence without phase); slower or equally fast plates are
interpolated. At the ends of the force record the window shrinks on both sides alike; outside of it the values are NaN. Forces and
moments are averaged, and the CoP is formed from the averages.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.signal import oaconvolve

from plumbline.filters import known, runs

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_LOAD = 20.0  # [N] vertical load below which a centre of pressure means nothing
BROKEN = 0.05  # [1] of the largest load on any plate: more load than this without a CoP is a fault, not an empty plate
EMPTY = 0.3  # [s] a plate that is light for longer stands empty
MIN_RATIO = 1.5  # [1] plate samples per frame from which on they are averaged


class Plate(Protocol):
    """A force plate in pipeline axes: reaction on the person [N], CoP [m] (NaN while unloaded), free moment [N m]."""

    time: Array
    force: Array
    cop: Array
    free_moment: Array
    corners: Array | None
    foot: str


@dataclass
class Forces:
    """Forces at the n frames: grf [N], zmp [m] (net and per foot), each (n, 3), NaN where unknown or unloaded.

    surface: height of the plates [m], NaN without plates.  feet: "left"/"right" -> (grf, cop).  notes: words.
    """

    grf: Array
    zmp: Array
    surface: float
    feet: dict[str, tuple[Array, Array]] = field(default_factory=dict)
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


def net(plates: Sequence[Plate], frames: Array) -> Forces:
    """Net and per-foot forces at the frames' times [s], shape (n,)."""
    n = len(frames)
    used = [p for p in plates if len(p.time) > 1 and known(p.cop).any()]
    out = Forces(np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.nan)
    if not used:
        return out
    out.surface = _surface(used)
    if not any(np.isfinite(p.force[:, 2]).any() for p in used):
        out.zmp = _cop_only(used, frames, out.notes)
        return out
    heavy = BROKEN * max(float(np.nanmax(p.force[:, 2])) for p in used if np.isfinite(p.force[:, 2]).any())
    wrenches = [_at_frames(p, frames, heavy, out.notes) for p in used]
    out.grf, out.zmp = _sum(wrenches, used)
    for side in ("left", "right"):
        mine = [i for i, p in enumerate(used) if p.foot == side]
        if mine:
            out.feet[side] = _sum([wrenches[i] for i in mine], [used[i] for i in mine])
    return out


def _sum(wrenches: Sequence[Array], plates: Sequence[Plate]) -> tuple[Array, Array]:
    """Force [N] and CoP [m] of several plates together, (n, 3) each; a force component that one lacks is NaN."""
    total = np.sum(wrenches, axis=0)
    force = total[:, :3].copy()
    force[:, [bool(any(np.isnan(p.force[:, k]).all() for p in plates)) for k in range(3)]] = np.nan
    return force, _cop(total, _surface(plates))


def _at_frames(plate: Plate, frames: Array, heavy: float, notes: list[str]) -> Array:
    """Force and moment about the origin of one plate at the frames, (n, 6); moments are NaN where a loaded plate has no CoP.

    A plate that stays light (no CoP, little load) for `EMPTY` counts as empty: zero, so that its zero error moves no CoP. In a
    shorter dip the small load is kept and acts at the interpolated CoP: dropping 20 of 700 N would move the ZMP by millimetres.
    """
    placed = known(plate.cop)
    broken = ~placed & (plate.force[:, 2] > heavy)
    empty = stays(~placed & ~broken, plate.time, EMPTY)
    force = np.where(empty[:, None], 0.0, np.nan_to_num(plate.force))
    cop = np.column_stack([np.interp(plate.time, plate.time[placed], plate.cop[placed, k]) for k in range(3)])
    moment = np.cross(cop, force)
    moment[:, 2] += np.nan_to_num(plate.free_moment)
    out = at_frames(np.hstack([force, moment, broken[:, None]]), plate.time, frames)
    if broken.any():
        out[out[:, 6] > 1e-6, 3:6] = np.nan  # the convolution leaves 1e-17 elsewhere
        notes.append(f"a loaded plate has no CoP in {broken.sum()} samples: no ZMP there")
    return out[:, :6]


def stays(flag: Mask, time: Array, least: float) -> Mask:
    """`flag` (n,) without its stretches shorter than `least` [s]; stretches at an end of the record are kept."""
    out = np.zeros(len(flag), dtype=bool)
    for a, b in runs(flag):
        if a == 0 or b == len(flag) or time[b - 1] - time[a] >= least:
            out[a:b] = True
    return out


def _cop(wrench: Array, height: float) -> Array:
    """Point of the plane z = height where the wrench has no horizontal moment [m], (n, 3); NaN below `MIN_LOAD`."""
    fx, fy, fz, mx, my = wrench[:, :5].T
    load = np.where(fz > MIN_LOAD, fz, np.nan)
    x, y = (height * fx - my) / load, (height * fy + mx) / load
    return np.column_stack([x, y, np.where(np.isfinite(x + y), height, np.nan)])


def _surface(plates: Sequence[Plate]) -> float:
    """Height of the plates [m]: mean over the plates of the median height of their CoP."""
    return float(np.mean([np.nanmedian(p.cop[:, 2]) for p in plates]))


def _cop_only(plates: Sequence[Plate], frames: Array, notes: list[str]) -> Array:
    """CoP of a recording without forces, [m], (n, 3): of its only plate."""
    if len(plates) > 1:
        notes.append(f"{len(plates)} centres of pressure without forces: no net one can be formed")
        return np.full((len(frames), 3), np.nan)
    good = known(plates[0].cop)
    return at_frames(plates[0].cop[good], plates[0].time[good], frames)
