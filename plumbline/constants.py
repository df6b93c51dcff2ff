"""Constants: a CoP, a CoM or a level that is off by a fixed amount. Told last, from constants that every model has."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from plumbline.contest import Case, Set, chance, decisive
from plumbline.physics import G

LEAST = 0.0003  # [m] a constant below it is nobody's business
FLOORS = 1.5  # [1] noise floors, the same
UNKNOWN = 0.001  # [m] the same where the floor is not known
CLEAR = 0.5  # [1] of what is left beside it
SURE = 4.0  # [1] standard errors
LEANING = 0.2  # [1] of a tilt's constant that may stand on the moment side too: the body leans with it
FOOT = 0.002  # [m] by which a person stands on the one side of both feet
SCALE = 0.005  # [1] to which the scale of a CoP is told
CHANCE = 0.01  # p of no such effect, below which it may take a constant with it
TAKES = 0.5  # [1] of the constant that may be left then
TELLS = 9.0  # [1] difference of squared distances in standard errors that tells a CoP from a CoM


@dataclass(frozen=True)
class Constant:
    """An effect told by its constant.

    effect: id, empty where only the family is known.  parameters: name -> value, lower, upper.  columns: base columns it stands for.
    size: what it adds to the error [m].  p: of none.
    """

    effect: str
    family: Set
    parameters: dict[str, tuple[float, float, float]]
    columns: Set
    size: float
    p: float


@dataclass(frozen=True)
class _Level:
    """A constant over the subjects: mean, standard error, rms [m or m/s2], p of none."""

    mean: float
    error: float
    rms: float
    p: float


def constants(case: Case, members: Set, feet: Sequence[Sequence[float]], place: float) -> list[Constant]:
    """Effects that are constants.  members: of the model.  feet: CoP from the middles of the feet, of each subject and trial [m].

    place: how far from the laboratory's origin people stand [m]: by as much does a constant err beside a CoP that is scaled from there.

    Nothing where a contact with a place of its own stands in the model: it takes the constants.
    """
    if case.placed(members):
        return []
    noise = float(case.floor[-1])
    least = max(LEAST, FLOORS * noise) if np.isfinite(noise) else UNKNOWN
    least += SCALE * place * ("gain" in members)
    clear = CLEAR if np.isfinite(noise) else 1.0
    out = []
    rest = dict(zip(case.equations, np.sqrt(case.inside(members)), strict=True))
    level = _level(case, members, "=kinematic") if decisive(case.sums[0])[0] and len(case.equations) > 1 else None
    w2 = float(np.mean([s.w2 for s in case.sums]))
    if level and level.rms / w2 > least and abs(level.mean) > SURE * level.error and level.rms > clear * rest["kinematic"]:
        value = (level.mean / G, (level.mean - 2 * level.error) / G, (level.mean + 2 * level.error) / G)
        out.append(Constant("tilt", ("tilt",), {"angle": value}, ("=kinematic",), level.rms / w2, level.p))
        least += LEANING * level.rms / w2
    level = _level(case, members, "=moment")
    if level.rms > least and level.rms > SURE * level.error and level.rms > clear * rest.get("moment", rest["whole"]):
        out.append(_moment(level, feet, _takers(case, members, level.rms), alone=len(case.equations) == 1))
    return out


def _takers(case: Case, members: Set, rms: float) -> Set:
    """Effects that would take most of the moment side's constant with them: a CoP that is scaled is also shifted, where a person stands."""
    others = (k for k in case.rivals if case.effects[k].recorded and k not in members)
    return tuple(
        k for k in others
        if chance(case, (*members, k), k) < CHANCE and not case.refusal((*members, k), k)
        and _level(case, (*members, k), "=moment").rms < TAKES * rms
    )  # fmt: skip


def _level(case: Case, members: Set, column: str) -> _Level:
    fits = [(s, case.fit(s, members)) for s in case.sums]
    each = np.array([float(f.of(s, column)[0][0]) for s, f in fits])
    own = np.array([float(np.sqrt(f.of(s, column)[1][0, 0])) for s, f in fits])
    error = float(np.sqrt(np.mean(own**2) / len(own)))
    few = max(sum(f.clusters for _, f in fits) - len(fits), 1)
    rms = float(np.sqrt(np.mean(each**2)))
    return _Level(float(each.mean()), error, rms, 2 * float(stdtr(few, -rms / max(error, 1e-300))))


def _moment(level: _Level, feet: Sequence[Sequence[float]], takers: Set = (), *, alone: bool) -> Constant:
    """Constant of x - p: a CoP that is shifted moves under both feet, a CoM does not.  takers: effects that bring such a constant."""
    offset = -level.mean
    known = np.array([np.nanmean(f) for f in feet if np.isfinite(f).any()])
    family: Set = ("offset", "com_bias", *(("tilt",) if alone else ()))
    if len(known):
        spread = [np.nanvar(f, ddof=1) / np.isfinite(f).sum() for f in feet if np.isfinite(f).sum() > 1]
        error = np.sqrt((FOOT**2 + (np.mean(spread) if spread else FOOT**2)) / len(known))
        tells = (known.mean() / error) ** 2 - ((known.mean() - offset) / error) ** 2
        if abs(tells) > TELLS:
            family = ("offset",) if tells > 0 else family[1:]
    effect = family[0] if not takers and (len(family) == 1 or (len(known) and len(family) == 2)) else ""
    family = (*family, *takers)
    half = 2 * level.error
    about = {
        "offset": {"b": (offset, offset - half, offset + half)},
        "com_bias": {"e0": (-offset, -offset - half, -offset + half)},
    }
    return Constant(effect, family, about.get(effect, {}), ("=moment",), level.rms, level.p)
