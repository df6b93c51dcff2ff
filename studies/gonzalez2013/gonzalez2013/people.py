"""Forty seeded people doing the paper's and a longer protocol: recordings made, estimators judged against the true CoM."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gonzalez2013.chain import Scene, scene
from plumbline import body as bodies
from plumbline.forces import Forces
from plumbline.markerset import MarkerSet, load
from plumbline.physics import G
from plumbline.simulate import gonzalez, routes
from plumbline.simulate import multi_contact as mc
from plumbline.simulate import nine_segments as nine
from plumbline.simulate.tasks import Pose

Array = NDArray[np.float64]
MARKERSET = Path(__file__).resolve().parents[1] / "markerset.yaml"

COP, MISALIGNED, SHAKEN = 0.002, 1.5, 0.4  # [m], [degrees], [degrees] of the instruments that are not perfect
FRAMES = 600  # over which errors are taken, evenly spread


@dataclass(frozen=True)
class Protocol:
    """Motions by name: `static` 300 s as in the paper, `volume` 60 s, `sts` 2 s standing up, `extended` 290 s."""

    motions: Mapping[str, mc.Motion]

    @cached_property
    def scenes(self) -> dict[str, Scene]:
        """What perfect markers see: the same for all people, whose masses alone differ."""
        return {k: seen(m, m.pose) for k, m in self.motions.items()}


def protocol(rate: float = 100.0, every: int = 1) -> Protocol:
    """The four motions.  rate [Hz].  every: of the extended protocol's poses only each so-many-th."""
    return Protocol(
        {
            "static": mc.paper(rate=rate),
            "volume": mc.volume(rate=rate),
            "sts": mc.sit_to_stand(rate=rate),
            "extended": routes.extended(rate, routes.EXTENDED[::every]),
        }
    )


def seen(motion: mc.Motion, pose: Pose) -> Scene:
    """What markers on a pose see, over plates that bear one body weight at a CoP of zero."""
    n, mass = len(motion.time), 70.0
    body = bodies.build(gonzalez.markers(nine.joints(pose.pelvis, pose.rotations)), markerset(), "")
    force = Forces(np.tile([0.0, 0.0, mass * G], (n, 1)), np.zeros((n, 3)), 0.0)
    return scene(body, force, motion.time, mass)


def markerset() -> MarkerSet:
    """The study's."""
    return load(MARKERSET)


def measured(s: Scene, ground: Array) -> Scene:
    """The same recording with a ground projection measured at each instant (n, 2) [m]."""
    return replace(s, windows=[replace(w, ground=s.at(w, ground)) for w in s.windows])


@dataclass(frozen=True)
class Seen:
    """One person in all motions.  scenes: what is measured, by motion.  com: the truth [m], (n, 3).  accelerated: of the CoM [m/s2]."""

    scenes: dict[str, Scene]
    com: dict[str, Array]
    accelerated: dict[str, Array]


def person(plan: Protocol, who: nine.Body, perfect: bool = True) -> Seen:
    """A seeded person.  perfect: markers without error; else segments are misaligned, shake, and the CoP is off by a constant."""
    seed = int(who.participant_id.rsplit("-", 1)[1])
    made = {k: mc.record(m, who, seed) for k, m in plan.motions.items()}
    scenes = plan.scenes
    shift = np.zeros(2)
    if not perfect:
        shift = np.random.default_rng([seed, 21]).normal(0.0, COP, 2)
        scenes = {k: seen(m, _spoilt(m.pose, seed, i)) for i, (k, m) in enumerate(plan.motions.items())}
    told = {k: measured(scenes[k], r.ground + shift) for k, r in made.items()}
    return Seen(told, {k: r.com for k, r in made.items()}, {k: r.acceleration for k, r in made.items()})


def _spoilt(pose: Pose, seed: int, motion: int) -> Pose:
    """Segments misaligned by a constant each, the same in all motions, and shaking."""
    turned = mc.misaligned(pose.rotations, seed, degrees=MISALIGNED)
    return Pose(pose.pelvis, mc.shaken(turned, 100 * seed + motion, degrees=SHAKEN))


def judged(com: Array, sd: Array, truth: Array) -> dict[str, Any]:
    """Errors of a CoM [m]: mean 3-D distance, mean ground distance, rms per axis, mean predicted sd upwards, its band's coverage [1]."""
    every = max(len(com) // FRAMES, 1)
    e, sd = (com - truth)[::every], sd[::every]
    out: dict[str, Any] = {"distance": np.linalg.norm(e, axis=1).mean(), "ground": np.linalg.norm(e[:, :2], axis=1).mean()}
    out |= {f"rms_{a}": v for a, v in zip("xyz", np.sqrt((e**2).mean(axis=0)), strict=True)}
    covered = np.mean(np.abs(e[:, 2]) < 1.96 * sd[:, 2]) if np.isfinite(sd).all() else np.nan
    return out | {"sd_z": sd[:, 2].mean(), "cover_z": covered}


def standing() -> bodies.Body:
    """A stick figure that stands upright, one frame."""
    pose = nine.joints(np.zeros((1, 3)), np.tile(np.eye(3), (1, 9, 1, 1)))
    return bodies.build(gonzalez.markers(pose), markerset(), "")
