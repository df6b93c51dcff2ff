"""Shapes without a cause that compete in the control ledger: where one wins, something is missing that no listed effect explains."""

from dataclasses import replace

import numpy as np

from plumbline.effects import Effect, Parameter
from plumbline.estimators.loop_error import Criterion
from plumbline.models.loop import Array, Now, Scene, Sizes, Term, simulate

FREQUENCIES = np.arange(0.15, 1.6, 0.02)  # [Hz] of a rhythm
HINT = 10.0  # log likelihood that a shape must gain frame by frame to be tried in the loop


def _kink(far: Array, now: Now, sizes: Sizes) -> Array:
    return np.asarray(far + sizes[0] * np.abs(far))


def _bend(far: Array, now: Now, sizes: Sizes) -> Array:
    return np.asarray(far + sizes[0] * far * far * far)


def _speed_kink(now: Now, sizes: Sizes) -> Array:
    return np.asarray(sizes[0] * np.abs(now.seen[1]))


def _speed_bend(now: Now, sizes: Sizes) -> Array:
    return np.asarray(sizes[0] * now.seen[1] * now.seen[1] * now.seen[1])


def _rhythm(now: Now, sizes: Sizes) -> Array:
    turn = 2 * np.pi * sizes[2] * now.time
    return np.asarray(sizes[0] * np.sin(turn) + sizes[1] * np.cos(turn))


def _shape(title: str, equation: str, term: Term, *parameters: Parameter) -> Effect:
    return Effect(title, "control", equation, "a shape, no cause", ("com_x", "zmp_x"), parameters, law=(term,))


SHAPES = {
    "~kink": _shape(
        "the gain on the position differs between the sides", r"k_1\,s\,|x - d|", Term("place", _kink, ((0.0,),), (1e-3,)),
        Parameter("s", "1", -0.9, 0.9, matters=0.05),
    ),
    "~bend": _shape(
        "the gain on the position changes with the distance", r"k_1\,s\,(x - d)^3", Term("place", _bend, ((0.0,),), (1e-2,)),
        Parameter("s", "1/m2", -400.0, 400.0, matters=3.0),
    ),
    "~speed_kink": _shape(
        "the gain on the velocity differs between the directions", r"s\,|\dot x|", Term("added", _speed_kink, ((0.0,),), (1e-3,)),
        Parameter("s", "s", -2.0, 2.0, matters=0.05),
    ),
    "~speed_bend": _shape(
        "the gain on the velocity changes with the speed", r"s\,\dot x^3", Term("added", _speed_bend, ((0.0,),), (1e-2,)),
        Parameter("s", "s3/m2", -100.0, 100.0, matters=0.5),
    ),
    "~rhythm": _shape(
        "the reference sways alike in all records", r"a \sin 2\pi f t + b \cos 2\pi f t",
        Term("reference", _rhythm, ((0.0, 0.0, 0.5),), (1e-5, 1e-5, 1e-4)),
        Parameter("a", "m", -0.1, 0.1, matters=1e-3), Parameter("b", "m", -0.1, 0.1, matters=1e-3), Parameter("f", "Hz", 0.1, 2.0),
    ),
}  # fmt: skip
"""name -> shape, as an effect that is never named."""


def offered(theta: Array, scene: Scene, whiten: Criterion) -> dict[str, Effect]:
    """The shapes that stand out frame by frame, beside a constant, x and x'; the rhythm begins at its best frequency.

    theta: d, k1, k2 of the law whose ZMP leaves what is searched; whiten: frees it of its colour.
    """
    far, v = scene.batch.x - theta[0], scene.batch.v
    time = scene.begun + (np.arange(len(far))[:, None] - scene.batch.lead) / scene.batch.rate
    turn = 2 * np.pi * FREQUENCIES[:, None] * time[:, None]

    def columns(*each: Array) -> Array:
        """Whitened columns (blocks of all loci, k) from (n, m) or (n, k, m)."""
        stacked = np.concatenate([one if one.ndim == 3 else one[:, None] for one in each], axis=1)
        out = whiten(np.stack([stacked, stacked]))
        return out.transpose(0, 2, 1).reshape(-1, out.shape[1])

    plain = np.linalg.qr(columns(np.ones_like(far), far, v))[0]
    error = columns(simulate(theta[:, None, None], scene, closed=False)[1])[:, 0]
    given = columns(np.abs(far), far * far * far, np.abs(v), v * v * v, np.sin(turn), np.cos(turn))
    error, given = error - plain @ (plain.T @ error), given - plain @ (plain.T @ given)
    alone, (sine, cosine) = given[:, :4], np.split(given[:, 4:], 2, axis=1)
    gained = (error @ alone) ** 2 / np.maximum((alone**2).sum(0), 1e-12) / 2
    out = {name: SHAPES[name] for name, gain in zip(("~kink", "~bend", "~speed_kink", "~speed_bend"), gained, strict=True) if gain > HINT}
    ss, sc, cc, es, ec = (sine**2).sum(0), (sine * cosine).sum(0), (cosine**2).sum(0), error @ sine, error @ cosine
    waves = (cc * es**2 - 2 * sc * es * ec + ss * ec**2) / np.maximum(ss * cc - sc**2, 1e-12) / 2
    best = int(np.argmax(waves))
    if waves[best] > HINT:
        rhythm = SHAPES["~rhythm"]
        out["~rhythm"] = replace(rhythm, law=(replace(rhythm.law[0], starts=((0.0, 0.0, float(FREQUENCIES[best])),)),))
    return out
