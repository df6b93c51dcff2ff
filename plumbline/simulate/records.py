"""What the laboratory records of a simulated trial: markers, two force plates (one per foot), noise."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from plumbline.simulate.jets import Array, Jet
from plumbline.simulate.mechanics import roll, turned
from plumbline.simulate.motion import WARM, Snapshot, State, World, between, snapshot
from plumbline.simulate.person import Subject
from plumbline.simulate.posture import Habits, pack, unpack, upper_joints

PLATE = (0.3, 0.6)  # [m] width and depth of a plate; the two meet at x = 0
CHUNK = 1000  # times worked out at once, so that arrays stay in the processor's cache
LEVER = 0.3  # [m] noise of a moment channel over that of a force channel


@dataclass(frozen=True)
class Plate:
    """One plate, k samples: the reaction on the person, axes right, forward, up.

    time: [s], (k,).  force: [N], (k, 3).  moment: about `centre` [N m], (k, 3).  centre: [m], (3,).  foot: "left" or "right".
    """

    time: Array
    force: Array
    moment: Array
    centre: Array
    foot: str

    @property
    def cop(self) -> Array:
        """Centre of pressure on the surface [m], (k, 3)."""
        place = np.stack([-self.moment[:, 1], self.moment[:, 0], 0 * self.moment[:, 2]], axis=1)
        return np.asarray(self.centre + place / self.force[:, 2:])

    @property
    def free_moment(self) -> Array:
        """Vertical moment about the CoP [N m], (k,)."""
        arm = self.cop - self.centre
        return np.asarray(self.moment[:, 2] - arm[:, 0] * self.force[:, 1] + arm[:, 1] * self.force[:, 0])

    @property
    def corners(self) -> Array:
        """Corners in the order of the C3D format for a plate whose own axes are right, back, down [m], (4, 3)."""
        w, d = PLATE[0] / 2, PLATE[1] / 2
        return np.asarray(self.centre + np.array([[w, -d, 0], [-w, -d, 0], [-w, d, 0], [w, d, 0]]))


#: what a fault of the instruments makes of all plates' records at once, and of all markers (times [s], (n,); label -> [m], (n, 3))
PlateFault = Callable[[list[Plate]], list[Plate]]
MarkerFault = Callable[[Array, dict[str, Array]], dict[str, Array]]


@dataclass(frozen=True)
class Lived:
    """A finished motion, asked for its forces and places at any times. motion: from `WARM` before the record."""

    world: World
    cast: Sequence[Subject]
    habits: Habits
    motion: State

    def _shots(self, times: Array) -> Iterator[tuple[Array, Array, Snapshot]]:
        """Times, postures and all about the body, in pieces."""
        for part in np.array_split(times, range(CHUNK, len(times), CHUNK)):
            table = pack(self.cast, self.habits, part[:, None])
            yield part, table, snapshot(self.world, table, between(self.motion, -WARM, part), part)

    def frames(self, times: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Markers by label, and the fields of `Snapshot` but levels, at times [s]; each (3, n, t)."""
        places: list[dict[str, Array]] = []
        shots: list[dict[str, Array]] = []
        for part, table, shot in self._shots(times):
            places.append(self._markers(part, table, shot))
            shots.append({name: value for name, value in shot._asdict().items() if name != "levels"})
        return _joined(places), _joined(shots)

    def ground(self, times: Array) -> Array:
        """Ground reaction and its moment about the origin, (6, n, t) [N, N m]."""
        parts = [np.concatenate([shot.ground, shot.ground_moment]) for _, _, shot in self._shots(times)]
        return np.concatenate(parts, axis=1)

    def _markers(self, time: Array, table: Array, shot: Snapshot) -> dict[str, Array]:
        """Places of all markers without noise [m], label -> (3, n, t): joint centres, C7, vertex, hips' middle, feet.

        Beside those that the segments end at, the feet carry MT1 and MT5, the inner and outer edge of the forefoot.
        """
        hips = shot.levels[0].vectors[:, 0]
        lean = roll(self.world.body, unpack(table), Jet(hips[0], hips[0], hips[0])).value
        out = {}
        for label, jets in upper_joints(self.cast, self.habits, time[:, None]).items():
            level = np.stack(np.broadcast_arrays(*(np.atleast_2d(j.value) for j in jets)))
            out[label] = hips + turned(level, np.cos(lean), np.sin(lean))
        for i, (side, sign) in enumerate((("R", 1.0), ("L", -1.0))):
            out |= _leg(self.cast, side, sign, hips, shot.levels[0].vectors[:, 2 + i])
        return out


def _joined(parts: list[dict[str, Array]]) -> dict[str, Array]:
    return {name: np.concatenate([p[name] for p in parts], axis=1) for name in parts[0]}


def _leg(subjects: Sequence[Subject], side: str, sign: float, hips: Array, knee: Array) -> dict[str, Array]:
    """Markers of one leg, label -> (3, n, t)."""

    def each(name: str) -> Array:
        return np.array([getattr(s, name) for s in subjects])

    def fixed(x: Array, y: Array, z: Array) -> Array:
        return np.broadcast_to(np.stack([x, y, z])[:, None], hips.shape)

    stance, none, low = sign * each("stance"), 0 * each("stance"), each("foot_height")
    foot = np.array([s.lengths["foot"] for s in subjects])
    ankle = fixed(stance, none, each("ankle"))
    hip = hips + fixed(sign * each("hip"), none, none)
    wide, ball, toe = sign * each("foot_width"), 0.7 * foot - each("heel"), foot - each("heel")
    out = {"HIP": hip, "KNE": ankle + knee, "ANK": ankle, "HEE": fixed(stance, -each("heel"), low)}
    out |= {
        "TOE": fixed(stance, toe, low),
        "MT1": fixed(stance - wide, ball, low),
        "MT5": fixed(stance + wide, ball, low),
    }
    return {side + label: place for label, place in out.items()}


def plates(subject: Subject, time: Array, ground: Array, turn: Array) -> list[Plate]:
    """Net ground reaction (3, k) and its moment about the origin, split over the right and the left plate, without noise.

    Each foot's CoP shifts sideways by w (p/(a + w))^3, a half the stance and w half a foot's width; the load follows from the
    net CoP p. So each CoP stays under its foot, the loads are positive and the net CoP is exact.
    """
    px, py = -turn[1] / ground[2], turn[0] / ground[2]
    a, w = subject.stance, subject.foot_width
    shift = w * (px / (a + w)) ** 3
    right = (px - shift + a) / (2 * a)
    free = turn[2] - px * ground[1] + py * ground[0]
    out = []
    for foot, sign, share in (("right", 1.0, right), ("left", -1.0, 1 - right)):
        centre = np.array([sign * PLATE[0] / 2, 0.0, 0.0])
        force, x = share * ground, sign * a + shift - centre[0]
        moment = np.stack([py * force[2], -x * force[2], x * force[1] - py * force[0] + share * free])
        out.append(Plate(time, force.T, moment.T, centre, foot))
    return out


def spoilt(plates: Sequence[Plate], faults: Sequence[PlateFault], noise: float, rng: np.random.Generator) -> list[Plate]:
    """The plates' records with their hidden faults and white noise: `noise` [N] on forces, 0.3 m times that on moments."""
    out = list(plates)
    for fault in faults:
        out = fault(out)
    noisy = []
    for plate in out:
        white = rng.standard_normal((len(plate.time), 6)) * noise * np.array([1, 1, 1, LEVER, LEVER, LEVER])
        noisy.append(replace(plate, force=plate.force + white[:, :3], moment=plate.moment + white[:, 3:]))
    return noisy
