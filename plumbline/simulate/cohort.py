"""A cohort of simulated studies: random bodies, controllers, noise and laboratories, with nothing, one or two effects hidden, or one
that stands in no catalogue. The truth stands beside each.

A study is drawn from a seed and a kind and is the same each time; effects' sizes are log-uniform from too small to be seen to
large, so that a search can be asked from which size on it finds them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from plumbline.physics import G
from plumbline.simulate.control import Controller, Law
from plumbline.simulate.hidden import CONTROL, OUTSIDE
from plumbline.simulate.human import SimulatedTrial, simulate
from plumbline.simulate.person import Inertia, Subject, draw_subject
from plumbline.simulate.posture import Habits

KINDS = ("clean", "one", "two", "outside")
RATES = ((100.0, 1000.0), (120.0, 1200.0), (200.0, 1000.0), (250.0, 1000.0))  # [Hz] markers, plates
OWN_BIAS = 0.01  # [1] by how much a person's own masses may stretch the CoM that the table gives; above it is an effect

Draw = Callable[[np.random.Generator, float], dict[str, Any]]


def _between(low: float, high: float, share: float) -> float:
    """Log-uniform size: `share` 0 to 1 of the way from low to high, three digits."""
    return float(f"{low * (high / low) ** share:.3g}")


def _side(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _spread(name: str, low: float, high: float, signed: bool = False, **others: tuple[float, float]) -> Draw:
    """Sizes of an effect: `name` log-uniform, of both signs if `signed`, the others uniform."""

    def draw(rng: np.random.Generator, share: float) -> dict[str, Any]:
        size = _between(low, high, share) * (_side(rng) if signed else 1.0)
        return {name: size} | {k: round(float(rng.uniform(*ends)), 4) for k, ends in others.items()}

    return draw


def _height(rng: np.random.Generator, share: float) -> dict[str, Any]:
    bounce = _between(0.003, 0.03, share)
    return {"amplitude": bounce, "frequency": round(float(rng.uniform(0.6, 1.3)), 3), "curve": round(45 * bounce * float(rng.uniform()), 3)}


def _push(rng: np.random.Generator, share: float) -> dict[str, Any]:
    sizes: dict[str, Any] = {"duration": round(float(rng.uniform(2.0, 5.0)), 2)}
    if rng.uniform() < 0.7:
        return sizes | {"lateral": _side(rng) * _between(2.0, 40.0, share), "height": round(float(rng.uniform(0.9, 1.4)), 3)}
    return sizes | {"lateral": 0.0, "force": _between(10.0, 150.0, share), "x": round(_side(rng) * float(rng.uniform(0.25, 0.5)), 3)}


def _bias(rng: np.random.Generator, share: float) -> dict[str, Any]:
    if rng.uniform() < 0.7:
        return {"scale": _side(rng) * _between(0.02, 0.15, share)}
    return {"e0": _side(rng) * _between(0.001, 0.025, share)}


def _zone(rng: np.random.Generator, share: float) -> dict[str, Any]:
    return {"half_width": _between(0.003, 0.03, share), "zone": str(rng.choice(["hold", "hold", "soft", "jump"]))}


def _lag(rng: np.random.Generator, share: float) -> dict[str, Any]:
    return {"time": _between(0.02, 0.15, share), "clip_last": bool(rng.uniform() < 0.5)}


def _soft(rng: np.random.Generator, share: float) -> dict[str, Any]:
    return {"frequency": _between(8.0, 3.0, share), "damping": round(float(rng.uniform(0.15, 0.5)), 3)}


#: effects of the catalogue that a study can tell, with their sizes from a generator and a share from 0 (smallest) to 1
INSIDE: dict[str, Draw] = {
    "ang_mom": _spread("amplitude", 0.003, 0.08, frequency=(0.4, 1.1)),
    "height": _height,
    "sync": _spread("delay", 0.001, 0.04, signed=True),
    "filter": _spread("cutoff", 30.0, 2.0),
    "offset": _spread("b", 0.0003, 0.02, signed=True),
    "tilt": _spread("a", 0.0003, 0.015, signed=True),
    "drift": _spread("c", 0.0001, 0.004, signed=True),
    "gain": _spread("q", 0.005, 0.12, signed=True),
    "com_bias": _bias,
    "soft_tissue": _soft,
    "hand": _spread("k", 15.0, 400.0, x=(-0.04, 0.04), height=(0.9, 1.3)),
    "push": _push,
    "delay": _spread("delay", 0.02, 0.15),
    "lag": _lag,
    "intermittent": _zone,
    "ref_drift": _spread("rate", 0.0003, 0.004, signed=True),
    "shear_scale": _spread("s", 0.005, 0.15, signed=True),
    "integral": _spread("ki", 0.02, 0.6),
    "limits": _spread("knee", 0.004, 0.04),
}

#: hidden effects that the catalogue of effects calls otherwise
CALLED = {"shear_scale": "force_scale"}

#: effects that stand in no catalogue
BEYOND: dict[str, Draw] = {
    "wall": _spread("k", 3e3, 1e5, x=(0.005, 0.04), height=(0.9, 1.3)),
    "cubic": _spread("k", 1e4, 4e5, height=(0.9, 1.3)),
    "periodic": _spread("size", 1.5, 25.0, frequency=(0.4, 1.5), height=(0.9, 1.3)),
    "friction": _spread("size", 0.7, 6.0, speed=(0.03, 0.1), height=(0.9, 1.3)),
    "magnet": _spread("size", 2.0, 25.0, x=(0.03, 0.08), reach=(0.01, 0.03), height=(0.9, 1.3)),
    "bent_cop": _spread("cubed", 0.5, 8.0),
    "hinged_cop": _spread("slope", 0.02, 0.4, edge=(0.03, 0.1)),
    "creep": _spread("share", 0.02, 0.25, time=(0.8, 2.5)),
    "lens": _spread("cubed", 1.0, 12.0),
    "rhythm": _spread("size", 0.003, 0.025, frequency=(0.25, 0.7)),
    "lopsided": _spread("share", 0.1, 0.9),
    "softening": _spread("bend", 0.3, 0.08),
    "hand_damper": _spread("c", 5.0, 150.0, height=(0.9, 1.3)),
}

#: pairs that no study can tell apart are not drawn together
CLASHES = (
    {"offset", "tilt", "com_bias"}, {"sync", "filter", "soft_tissue"}, {"gain", "com_bias", "hand"}, {"delay", "lag"},
    {"delay", "intermittent"}, {"lag", "intermittent"}, {"push", "hand"}, {"soft_tissue", "com_bias"}, {"push", "soft_tissue"},
    {"shear_scale", "gain"}, {"shear_scale", "com_bias"}, {"shear_scale", "hand"}, {"shear_scale", "soft_tissue"},
    {"integral", "ref_drift"}, {"integral", "intermittent"}, {"limits", "lag"}, {"limits", "delay"}, {"limits", "intermittent"},
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One study of a cohort, not yet simulated.

    seed, kind: what it was drawn from.  subjects, controllers, habits: one each per person.  effects: name -> sizes, the truth.
    trials: per person.  duration [s], rate, force_rate [Hz], marker_noise [m], force_noise [N]: of the laboratory.
    """

    seed: int
    kind: str
    subjects: tuple[Subject, ...]
    controllers: tuple[Controller, ...]
    habits: tuple[Habits, ...]
    effects: dict[str, dict[str, Any]]
    trials: int
    duration: float
    rate: float
    force_rate: float
    marker_noise: float
    force_noise: float

    def truth(self) -> dict[str, Any]:
        """What is hidden, by the catalogue's names: effects with sizes, those of each ledger, whether all stand there; and draws."""
        control = sorted(set(self.effects) & CONTROL)
        plant = sorted(set(self.effects) - CONTROL)
        return {
            "seed": self.seed,
            "kind": self.kind,
            "effects": {CALLED.get(k, k): sizes for k, sizes in self.effects.items()},
            "plant": [CALLED.get(k, k) for k in plant],
            "control": control,
            "inside": not set(self.effects) & OUTSIDE,
            "subjects": [{"mass": s.mass, "height": s.height, "sex": s.sex, "bias": bias(s)} for s in self.subjects],
            "controllers": [asdict(c.lateral) for c in self.controllers],
            "lean": [h.follow for h in self.habits],
            **{k: getattr(self, k) for k in ("trials", "duration", "rate", "force_rate", "marker_noise", "force_noise")},
        }

    def simulate(self) -> list[SimulatedTrial]:
        """All recordings, subject by subject."""
        return simulate(
            self.subjects, trials=self.trials, duration=self.duration, seed=self.seed, effects=self.effects, rate=self.rate,
            force_rate=self.force_rate, marker_noise=self.marker_noise, force_noise=self.force_noise, controller=self.controllers,
            habits=self.habits,
        )  # fmt: skip


def draw(seed: int, kind: str, *, names: tuple[str, ...] = (), share: tuple[float, float] = (0.0, 1.0), **laboratory: Any) -> Case:
    """A study from a seed.

    kind: "clean", "one", "two" (effects of the catalogue) or "outside".  names: these effects, in place of drawn ones.  share: between
    which sizes, 0 the smallest, 1 the largest.  laboratory: numbers of `Case` (trials, rate, ...) or `people`, in place of drawn ones.
    Raises ValueError for an unknown kind.
    """
    if kind not in KINDS:
        raise ValueError(f"no kind of study is called {kind!r}; there are {', '.join(KINDS)}")
    rng = np.random.default_rng([seed, KINDS.index(kind), 7])
    people = laboratory.pop("people", None) or int(rng.choice([1, 1, 1, 2, 3]))
    rate, force_rate = RATES[int(rng.integers(len(RATES)))]
    lab: dict[str, Any] = {
        "trials": int(rng.integers(6, 17)) if people == 1 else int(rng.integers(6, 9)),
        "duration": round(float(rng.uniform(10.0, 16.0)), 1), "rate": rate, "force_rate": force_rate,
        "marker_noise": round(float(rng.uniform(0.3e-3, 1.5e-3)), 6), "force_noise": round(float(rng.uniform(0.5, 2.0)), 3),
    } | laboratory  # fmt: skip
    chosen = names or _names(rng, kind)
    sizes = BEYOND | INSIDE
    effects = {name: sizes[name](rng, float(rng.uniform(*share))) for name in chosen}
    subjects = tuple(_person(i, rng) for i in range(1, people + 1))
    controllers = tuple(_controller(s, effects, rng) for s in subjects)
    habits = tuple(Habits(follow=round(float(rng.uniform(0.0, 0.4)), 3)) for _ in subjects)
    return Case(seed, kind, subjects, controllers, habits, effects, **lab)


def _names(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    """Effects of a kind of study; no pair of `CLASHES`."""
    pool = list(BEYOND if kind == "outside" else INSIDE)
    if kind == "clean":
        return ()
    if kind != "two":
        return (str(rng.choice(pool)),)
    while True:
        pair = {str(name) for name in rng.choice(pool, 2, replace=False)}
        if not any(pair <= clash for clash in CLASHES):
            return tuple(sorted(pair))


def _person(number: int, rng: np.random.Generator) -> Subject:
    """A person of random size, sex and deviation whose own bias is the person, not an effect."""
    while True:
        sex, personal = str(rng.choice(["M", "F"])), float(rng.uniform(0.0, 0.03))
        drawn = draw_subject(f"sub-{number:02d}", int(rng.integers(2**31)), sex=sex, personal=personal)
        if abs(bias(drawn)) < OWN_BIAS:
            return replace(drawn, push=round(float(rng.uniform(0.6, 0.9)), 3))


def bias(subject: Subject) -> float:
    """By how much the table's numbers stretch this person's CoM when the legs lean under an upright trunk [1]."""
    knee = subject.lengths["shank"] / (subject.lengths["shank"] + subject.lengths["thigh"])

    def travel(segments: dict[str, Inertia]) -> float:
        """Lateral travel of the CoM per travel of the hips [1]."""
        thigh, shank, foot = (segments[n] for n in ("thigh", "shank", "foot"))
        legs = thigh.mass * (1 - thigh.com * (1 - knee)) + shank.mass * knee * (1 - shank.com)
        return 1 - 2 * (thigh.mass + shank.mass + foot.mass) + 2 * legs

    return travel(subject.nominal) / travel(subject.segments) - 1


def _controller(subject: Subject, effects: dict[str, dict[str, Any]], rng: np.random.Generator) -> Controller:
    """A law that keeps this person standing with the study's delay and lag: gains are drawn until it does."""
    late = effects.get("delay", {}).get("delay", 0.0), effects.get("lag", {}).get("time", 0.0)
    omega = float(np.sqrt(G / (0.56 * subject.height)))
    while True:
        k1, damping = float(rng.uniform(1.8, 5.0)), float(rng.uniform(0.55, 1.1))
        k2 = 2 * damping * float(np.sqrt(k1 - 1)) / omega
        if settles(k1, k2, omega, *late):
            break
    low, high = -float(rng.uniform(0.15, subject.reach)), float(rng.uniform(0.15, subject.reach))
    lateral = Law(
        round(k1, 3), round(k2, 4), round(low + 5e-4, 4), round(high - 5e-4, 4), round(float(rng.uniform(-0.015, 0.015)), 4),
        round(float(rng.uniform(1.5e-3, 4e-3)), 5), round(float(rng.uniform(0.15, 0.5)), 3),
    )  # fmt: skip
    heel, toe = subject.heel, subject.lengths["foot"] - subject.heel
    forward = Law(2.0, 0.6, -0.6 * heel, 0.7 * toe, 0.3 * toe, round(float(rng.uniform(1e-3, 3e-3)), 5))
    return Controller(lateral, forward)


def settles(k1: float, k2: float, omega: float, delay: float, lag: float) -> bool:
    """Whether a pendulum under this law loses nine tenths of a disturbance in 3 s and never overshoots by more than half."""
    step = 0.005
    back = round(delay / step)
    x, v, p = 1.0, 0.0, 0.0
    past = [(0.0, 0.0)] * (back + 1)
    path = []
    for _ in range(round(3.0 / step)):
        past = [*past[1:], (x, v)]
        ask = k1 * past[0][0] + k2 * past[0][1]
        p = p + step / lag * (ask - p) if lag > step else ask
        v += step * omega**2 * (x - p)
        x += step * v
        path.append(x)
        if abs(x) > 2.0:
            return False
    return max(map(abs, path[-100:])) < 0.1 and min(path) > -0.5
