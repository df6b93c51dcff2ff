"""Whose foot a plate carries: by the markers nearest to its CoP. Pipeline axes, SI."""

from collections.abc import Mapping

import numpy as np

from plumbline.axes import side_of
from plumbline.loads import Plate
from plumbline.readers.raw import Array

BAND = 0.12  # [m] markers with a side within this height of the lowest one belong to a foot
FAR = 0.4  # [m] a CoP further than this from the foot on its plate is no CoP of that foot


def groups(markers: Mapping[str, Array]) -> dict[str, Array]:
    """Markers of each foot, side -> (n, k, 3) [m]; a side without any is left out.

    A foot's markers are those with a side in their name whose lowest height (5th percentile) lies within 12 cm of the lowest.
    """
    sided = {label: side_of(label)[0] for label, values in markers.items() if np.isfinite(values[:, 2]).any()}
    height = {label: float(np.nanpercentile(markers[label][:, 2], 5)) for label, side in sided.items() if side}
    low = min(height.values(), default=0.0) + BAND
    found = {side: [markers[x] for x, h in height.items() if h <= low and sided[x] == side] for side in ("left", "right")}
    return {side: np.stack(group, axis=1) for side, group in found.items() if group}


def places(markers: Mapping[str, Array]) -> dict[str, Array]:
    """Mean horizontal place of each foot's markers, side -> (n, 2) [m]; empty where a side has none."""
    out: dict[str, Array] = {}
    for side, group in groups(markers).items():
        count = np.isfinite(group[..., :2]).sum(axis=1)
        out[side] = np.where(count > 0, np.nansum(group[..., :2], axis=1) / np.maximum(count, 1), np.nan)
    return out if len(out) == 2 else {}


def assign(plates: list[Plate], time: Array, feet: dict[str, Array], notes: list[str], known_lateral: bool) -> None:
    """Which foot each plate carries (in place): the foot whose markers are nearer to its CoP; else the side of two plates.

    feet: side -> mean horizontal place of the foot's markers, shape (n, 2), at `time`.  A foot the file states is kept.
    """
    for plate in (p for p in plates if not p.foot and len(feet) == 2):
        plate.foot = _nearest(plate, time, feet)
    free = [p for p in plates if not p.foot]
    if len(plates) == 2 and len(free) == 2 and not feet and known_lateral:
        places = [float(np.nanmedian(p.cop[:, 0])) for p in plates]
        if abs(places[0] - places[1]) > 0.05:
            plates[int(np.argmin(places))].foot, plates[int(np.argmax(places))].foot = "left", "right"
            notes.append("no foot markers: the plate on the left carries the left foot")
    for plate in plates:
        _check_distance(plate, time, feet, notes)


def _distances(plate: Plate, time: Array, foot: Array) -> Array:
    """Horizontal distance of the CoP from a foot's markers [m], shape (k,); NaN without CoP or markers."""
    inside = (plate.time >= time[0]) & (plate.time <= time[-1])
    place = np.column_stack([np.interp(plate.time, time, c) for c in foot.T])
    return np.where(inside, np.linalg.norm(plate.cop[:, :2] - place, axis=1), np.nan)


def _nearest(plate: Plate, time: Array, feet: dict[str, Array]) -> str:
    """The foot that is clearly nearer during 80 % of the load, else "" (both feet on the plate, or taking turns)."""
    left, right = (_distances(plate, time, feet[s]) for s in ("left", "right"))
    known = np.isfinite(left) & np.isfinite(right)
    if not known.any():
        return ""
    for side, near, far in (("left", left, right), ("right", right, left)):
        if np.mean((near < 0.7 * far)[known]) > 0.8:
            return side
    return ""


def _check_distance(plate: Plate, time: Array, feet: dict[str, Array], notes: list[str]) -> None:
    """A CoP that no foot can reach is set missing, and with it the moment, with a note.

    Where this befalls most of the load, the moments of light samples are not to be trusted either.
    """
    if plate.foot not in feet:
        return
    distance = _distances(plate, time, feet[plate.foot])
    loaded = np.isfinite(plate.cop[:, 0])
    far = distance > FAR
    if far.any():
        plate.cop[far] = np.nan
        plate.free_moment[far] = np.nan
        plate.moment[far | ~loaded if far.sum() > 0.5 * loaded.sum() else far] = np.nan
        notes.append(
            f"plate {plate.number}: CoP more than {FAR:g} m from the {plate.foot} foot's markers in {far.sum()} of {loaded.sum()} "
            "loaded samples; set missing"
        )
