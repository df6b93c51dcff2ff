"""Borders of the support: from the feet's markers, else from the plates, else unknown.

A foot on the floor is support however little it bears: the person can shift the load to it. A foot that is off the floor
(``plumbline/contact.py``) is none, unless its plate bears more than 80 N meanwhile (on tiptoe, with markers at the heel only).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from plumbline.body import points
from plumbline.contact import Foot
from plumbline.forces import Forces, Plate
from plumbline.loads import LOADED, NO_FOOT
from plumbline.markerset import MarkerSet

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FOOT_HALF_WIDTH = 0.05  # [m] a foot's outline beside markers on its middle line; foot breadth is 0.055 of body height (Winter 2009)


@dataclass
class Support:
    """left, right (x) and back, front (y) borders [m], (n, 4), NaN where unknown.  source: markers, plates or none."""

    limits: Array
    source: str
    note: str


def foot_markers(markerset: MarkerSet) -> tuple[dict[str, tuple[str, ...]], float]:
    """Markers of each foot's outline and the width [m] to add: the set's `support`, else the ends of its foot segments."""
    if markerset.support:
        return dict(markerset.support), markerset.half_width if markerset.half_width is not None else 0.0
    ends = {s.name.removeprefix("foot_"): s.markers for s in markerset.segments if s.name in ("foot_left", "foot_right")}
    return ends, FOOT_HALF_WIDTH


def feet(markers: Mapping[str, Array], markerset: MarkerSet) -> dict[str, Array]:
    """Outline markers of each foot [m], "left"/"right" -> (n, k, 3); a foot without a seen marker is left out."""
    have = points(markers, markerset)
    out = {}
    for side, names in foot_markers(markerset)[0].items():
        seen = [have[m] for m in names if m in have and np.isfinite(have[m]).any()]
        if seen:
            out[side] = np.stack(seen, axis=1)
    return out


def limits(
    outline: Mapping[str, Array],
    markerset: MarkerSet | None,
    standing: Mapping[str, Foot],
    forces: Forces,
    plates: Sequence[Plate],
) -> Support:
    """Support borders of each of n frames; unknown in frames in which a foot that may stand is not seen.

    outline: as :func:`feet` gives it.  standing: side -> whether the foot is off the floor.
    """
    n = len(forces.grf)
    if outline and markerset is not None:
        width = foot_markers(markerset)[1]
        note = f"support limits from the markers of {' and '.join(sorted(outline))} foot, widened by {width * 1000:.0f} mm"
        return Support(_from_feet(outline, standing, forces, width), "markers", note)
    corners = [p.corners for p in plates if p.corners is not None and p.foot != NO_FOOT and np.isfinite(p.cop).any()]
    if corners:
        border = _box(np.concatenate(corners)[None])
        return Support(np.repeat(border, n, axis=0), "plates", "support limits from the loaded plates' corners")
    return Support(np.full((n, 4), np.nan), "none", "no foot markers and no plate corners: support limits unknown")


def _from_feet(outline: Mapping[str, Array], standing: Mapping[str, Foot], forces: Forces, width: float) -> Array:
    down, unseen = [], np.zeros(len(forces.grf), dtype=bool)
    for side, xyz in outline.items():
        foot = np.array(xyz)
        off = _off(side, standing, forces)
        unseen |= ~off & np.isnan(foot[..., 0]).all(axis=1)
        foot[off] = np.nan
        down.append(foot)
    box = _box(np.concatenate(down, axis=1)) + width * np.array([-1.0, 1.0, -1.0, 1.0])
    return np.where(unseen[:, None], np.nan, box)


def _off(side: str, standing: Mapping[str, Foot], forces: Forces) -> Mask:
    """Frames in which a foot is off the floor, (n,)."""
    off = standing[side].off if side in standing else np.zeros(len(forces.grf), dtype=bool)
    return off & ~(forces.feet[side][0][:, 2] > LOADED) if side in forces.feet else off


def _box(xyz: Array) -> Array:
    """Smallest and largest x and y over the points of each frame, (n, 4); NaN where none is seen."""
    low = np.where(np.isnan(xyz), np.inf, xyz).min(axis=1)
    high = np.where(np.isnan(xyz), -np.inf, xyz).max(axis=1)
    box = np.column_stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]])
    return np.where(np.isfinite(box), box, np.nan)
