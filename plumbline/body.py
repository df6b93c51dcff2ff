r"""The body as a chain of segments: made points, whole-body CoM and angular momentum.

A segment with ends :math:`a` (proximal) and :math:`b` (distal) has its CoM at :math:`a + c\,(b - a)`. Known by two points, it
turns with :math:`\Omega = u \times \dot u`, :math:`u = (b - a)/|b - a|`; a turn about its own long axis is not seen and left out.
Harrington ME et al. (2007) J Biomech 40:595-602 for hip centres; de Leva 1996 for the numbers (``plumbline/segments.py``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbline import rigid
from plumbline.filters import known, low_pass
from plumbline.markerset import MarkerSet, Segment, point_inputs, share_of
from plumbline.segments import Numbers

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MIN_MASS = 0.9  # [1] share of body mass below which no CoM is given
BEND = 4.0  # [Hz] a back bends slower than this; what is faster is noise, which the head's distance from the breastbone makes larger
FORWARD = np.array([0.0, 1.0, 0.0])  # pipeline axes: the subject's back-to-front direction ...
UP = np.array([0.0, 0.0, 1.0])  # ... and away from the ground


@dataclass
class Body:
    """Segments of one trial that have their markers.

    names, numbers: per segment.  proximal, distal: [m], shape (n, s, 3); where only some segments are missing in a frame,
    `bridge` has put them where they last were relative to the others, and `filled` (n,) says so.
    share: mass share of the segments.  missing: words, one entry per segment without markers.  notes: words.
    """

    names: list[str]
    numbers: list[Numbers]
    proximal: Array
    distal: Array
    filled: Mask
    missing: list[str]
    notes: list[str]

    @property
    def share(self) -> float:
        """Share of body mass that has segments."""
        return float(sum(n.mass for n in self.numbers))

    @property
    def masses(self) -> Array:
        """Mass share of each segment [1], shape (s,)."""
        return np.array([n.mass for n in self.numbers])

    def centres(self) -> Array:
        """CoM of each segment [m], shape (n, s, 3)."""
        c = np.array([n.com for n in self.numbers])[:, None]
        return np.asarray(self.proximal + c * (self.distal - self.proximal))

    def com(self) -> Array:
        """Whole-body CoM [m], shape (n, 3); NaN in frames without it, and everywhere below `MIN_MASS`."""
        n = len(self.proximal)
        if self.share < MIN_MASS - 1e-9:
            return np.full((n, 3), np.nan)
        return np.asarray(np.einsum("nsk,s->nk", self.centres(), self.masses) / self.share)

    def angular_momentum(self, time: Array, mass: float) -> Array:
        r"""Angular momentum about the CoM [kg m2/s], shape (n, 3).

        :math:`L = \sum_i m_i (r_i - c) \times (v_i - \dot c) + I_i \Omega_i`; velocities by central differences of the positions
        as they are. Segment masses are shares of `mass` [kg]; what has no segment is left out.
        """
        if len(time) < 2 or self.share < MIN_MASS - 1e-9:
            return np.full((len(time), 3), np.nan)
        r = self.centres()
        r = r - np.einsum("nsk,s->nk", r, self.masses)[:, None] / self.share
        v = np.gradient(r, time, axis=0)
        return np.asarray(mass * (np.einsum("nsk,s->nk", np.cross(r, v), self.masses) + self._spin(time)))

    def _spin(self, time: Array) -> Array:
        """Sum of the segments' own angular momenta per body mass [m2/s], shape (n, 3).

        The turn about the segment's sagittal axis (forward, made normal to the long axis) uses the sagittal radius, the rest the
        transverse one.
        """
        d = self.distal - self.proximal
        length = np.linalg.norm(d, axis=2, keepdims=True)
        u = d / length
        omega = np.cross(u, np.gradient(u, time, axis=0))
        s = FORWARD - (u @ FORWARD)[..., None] * u
        norm2 = np.einsum("nsk,nsk->ns", s, s)[..., None]
        about = s * np.einsum("nsk,nsk->ns", omega, s)[..., None] / np.where(norm2 > 0.05, norm2, np.inf)
        ks, kt = (np.array([getattr(n, a) for n in self.numbers])[:, None] for a in ("sagittal", "transverse"))
        spin = length**2 * (kt**2 * omega + (ks**2 - kt**2) * about)
        return np.asarray(np.einsum("nsk,s->nk", spin, self.masses))


def points(
    markers: Mapping[str, Array], markerset: MarkerSet, sex: str = "", time: Array | None = None, notes: dict[str, list[str]] | None = None
) -> dict[str, Array]:
    """Markers under the set's names, with the set's made points, each [m], shape (n, 3).

    time: [s], shape (n,); without it the bend of the back is not smoothed.  notes: what is to be said of carried points is added
    here, as sentence -> the points it is true of.
    """
    out = {name: markers[label] for name, label in markerset.resolve(markers).items()}
    said: dict[str, list[str]] = {} if notes is None else notes
    for name, spec in markerset.points.items():
        if name in out or not out.keys() >= set(point_inputs(spec)):
            continue  # the segment that needs it is reported as missing, with its markers
        out[name], note = _made(spec, out, sex, time)
        if note:
            said.setdefault(note, []).append(name)
    return out


def mean(names: Any, have: Mapping[str, Array]) -> Array:
    """Mean of the named points; NaN where one of them is (a mean of the rest would jump)."""
    return np.asarray(sum(have[n] for n in names) / len(names))


def _made(spec: Mapping[str, Any], have: Mapping[str, Array], sex: str, time: Array | None) -> tuple[Array, str]:
    """A made point and what is to be said of it."""
    if "hip" in spec:
        asis = [have[n] for n in spec["asis"]]
        return hip_centre(asis[0], asis[1], mean(spec["psis"], have), spec["hip"]), ""
    if "mean" in spec:
        return mean(spec["mean"], have), ""
    start, end = mean(spec["from"], have), mean(spec["to"], have)
    if "upright" in spec:
        return mean(spec["at"], have) + share_of(spec, sex) * _standing_length(start, end) * UP, ""
    point = mean(spec["at"], have) + share_of(spec, sex) * (end - start)
    if "carried" not in spec:
        return point, ""
    off, note = _off_the_line(point, start, end, spec["carried"], have)
    if time is not None and len(time) > 3:
        off = low_pass(off, time, min(BEND, 0.2 / float(np.median(np.diff(time)))))
    return point + off, note


def _standing_length(start: Array, end: Array) -> float:
    """Length of the line start - end at its upright moment [m]; NaN where it is never seen."""
    moment = rigid.upright(start, end)
    return float(np.linalg.norm((end - start)[moment.frames], axis=1).mean()) if moment else float("nan")


def _off_the_line(point: Array, start: Array, end: Array, by: Sequence[str], have: Mapping[str, Array]) -> tuple[Array, str]:
    """How far [m], (n, 3), the markers `by` carry a point off the line start - end, on which it lies when upright; and a note.

    Nowhere where fewer than three of the markers are seen in most of its frames. In the other frames it stays as far off as it is
    before and after.
    """
    on = known(point)
    there = [n for n in by if n in have and (known(have[n]) & on).sum() > on.sum() / 2]
    line = "on a straight line in every frame (the back taken as straight):"
    if len(there) < rigid.CARRIERS:
        return np.zeros_like(point), f"{line} of {', '.join(by)} only {', '.join(there) or 'none'} is seen"
    markers = np.stack([have[n] for n in there], axis=1)
    moment = rigid.upright(np.where((known(markers).all(axis=1) & on)[:, None], start, np.nan), end)
    off = rigid.carry(point, markers, moment.frames) - point if moment else np.full_like(point, np.nan)
    if moment is None or not known(off).any():
        return np.zeros_like(point), f"{line} {', '.join(there)} tell no turn"
    note = f"placed where the trunk leans {moment.lean:.0f} deg, no frame is nearer upright" if moment.lean > rigid.LEANS else ""
    return _carried(off, known(off)), note


def hip_centre(right_asis: Array, left_asis: Array, mid_psis: Array, side: str) -> Array:
    """Hip joint centre from pelvis width and depth (Harrington 2007, the forms without leg length).

    right_asis, left_asis, mid_psis: [m], shape (n, 3).  side: "right" or "left".  Returns [m], shape (n, 3).
    """
    middle = (right_asis + left_asis) / 2.0
    width = np.linalg.norm(right_asis - left_asis, axis=1, keepdims=True)
    back = middle - mid_psis
    depth = np.linalg.norm(back, axis=1, keepdims=True)
    z = (right_asis - left_asis) / width
    x = back - np.sum(back * z, axis=1, keepdims=True) * z
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(z, x)
    sign = 1.0 if side == "right" else -1.0
    forward, up, out = -0.24 * depth - 0.0099, -0.30 * width - 0.0109, 0.33 * width + 0.0073
    return np.asarray(middle + forward * x + up * y + sign * out * z)


def build(markers: Mapping[str, Array], markerset: MarkerSet, sex: str, time: Array | None = None) -> Body:
    """Segments of a trial from its markers ([m], label -> (n, 3)) and a marker set.

    time: [s], shape (n,), for the smoothing of the back's bend.

    A segment never seen is named in `missing` with its markers; one missing in some frames only is bridged.
    """
    said: dict[str, list[str]] = {}
    have = points(markers, markerset, sex, time, said)
    found = [(s, mean(s.proximal, have), mean(s.distal, have)) for s in markerset.segments if set(s.markers) <= set(have)]
    found = [(s, a, b) for s, a, b in found if known(a + b).any()]
    names = {s.name for s, _, _ in found}
    missing = [_lack(s, have, markerset) for s in markerset.segments if s.name not in names]
    n = len(next(iter(markers.values()))) if markers else 0
    a = np.stack([f[1] for f in found], axis=1) if found else np.zeros((n, 0, 3))
    b = np.stack([f[2] for f in found], axis=1) if found else np.zeros((n, 0, 3))
    notes = [f"{', '.join(names)} {note}" for note, names in said.items()]
    body = Body([s.name for s, _, _ in found], [s.numbers(sex) for s, _, _ in found], a, b, np.zeros(n, bool), missing, notes)
    _bridge(body)
    if sex == "" and body.share >= MIN_MASS and any(s.table for s, _, _ in found):
        body.notes.append("sex not stated in participants.tsv: segment numbers are the mean of both sexes")
    if missing and body.share >= MIN_MASS:
        body.notes.append(f"the CoM leaves out {1.0 - body.share:.1%} of body mass that has no segment")
    return body


def _lack(segment: Segment, have: Mapping[str, Array], markerset: MarkerSet) -> str:
    def gone(name: str) -> list[str]:
        if name in have and known(have[name]).any():
            return []
        sources = point_inputs(markerset.points.get(name, {}))
        return [x for s in sources for x in gone(s)] or [name] if sources else [name]

    lacking = dict.fromkeys(x for name in segment.markers for x in gone(name))
    return f"{segment.name} ({', '.join(lacking)})"


def _bridge(body: Body) -> None:
    """Keep a segment that is missing in a few frames where it last was relative to the others, and flag the frames.

    Dropping it for some frames only would make the CoM jump. In a frame where segments of less than `MIN_MASS` are seen, all are
    set to NaN.
    """
    _drop_unusable(body)
    seen = known(body.proximal + body.distal)
    usable = np.asarray(seen @ body.masses >= MIN_MASS - 1e-9)
    steady = np.asarray(seen[usable].all(axis=0))
    gappy = ~steady if usable.any() and steady.any() else np.zeros(len(steady), dtype=bool)
    usable &= np.asarray(seen[:, ~gappy].all(axis=1))
    m = body.masses * steady
    anchor = np.einsum("nsk,s->nk", np.nan_to_num(body.centres()), m) / max(m.sum(), 1e-12)
    for s in np.flatnonzero(gappy):
        there = seen[:, s] & usable
        for ends in (body.proximal, body.distal):
            ends[:, s] = anchor + _carried(ends[:, s] - anchor, there)
        body.notes.append(
            f"{body.names[s]} is not seen in {int((usable & ~there).sum())} frames: kept in place relative to the other segments there"
        )
    body.proximal[~usable] = body.distal[~usable] = np.nan
    body.filled |= usable & ~np.asarray(seen.all(axis=1))


def _drop_unusable(body: Body) -> None:
    """Leave out segments that are only seen in frames where too little of the rest is."""
    seen = known(body.proximal + body.distal)
    usable = seen @ body.masses >= MIN_MASS - 1e-9
    keep = np.asarray(seen[usable].any(axis=0)) if usable.any() else np.ones(len(body.names), dtype=bool)
    body.missing += [f"{name} (never seen together with the rest)" for name, k in zip(body.names, keep, strict=True) if not k]
    body.names = [name for name, k in zip(body.names, keep, strict=True) if k]
    body.numbers = [number for number, k in zip(body.numbers, keep, strict=True) if k]
    body.proximal, body.distal = body.proximal[:, keep], body.distal[:, keep]


def _carried(offset: Array, there: Mask) -> Array:
    where = np.arange(len(offset))
    return np.stack([np.interp(where, where[there], offset[there, k]) for k in range(3)], axis=1)


def inputs(markerset: MarkerSet, names: list[str]) -> set[str]:
    """Markers (under the set's names) that the named segments are made of, through made points."""
    todo = [m for s in markerset.segments if s.name in names for m in s.markers]
    out: set[str] = set()
    while todo:
        name = todo.pop()
        if name in out:
            continue
        out.add(name)
        spec = markerset.points.get(name, {})
        todo += [*point_inputs(spec), *spec.get("carried", ())]
    return out
