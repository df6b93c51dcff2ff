"""A dead zone: near the reference the law does not act, or holds the ZMP where it is."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term

RATE = 3.0  # [rad/s] makes a place of a velocity where the ZMP is held: about the omega of a standing person


def soft(far: Array, now: Now, sizes: Sizes) -> Array:
    """What is left of x - d beyond the zone [m]."""
    return np.asarray(far - np.minimum(np.maximum(far, -sizes[0]), sizes[0]))


def jump(far: Array, now: Now, sizes: Sizes) -> Array:
    """x - d outside the zone, 0 within [m]."""
    return np.where(np.abs(far) < sizes[0], 0.0, far)


def hold(p: Array, now: Now, sizes: Sizes) -> Array:
    """The ZMP as it was while the state is within the zone [m]."""
    return np.where(np.abs(now.far + now.seen[1] / RATE) < sizes[0], now.kept, p)


STARTS = ((0.004,), (0.006,), (0.009,), (0.0125,), (0.0175,), (0.025,), (0.035,), (0.05,))

EFFECT = Effect(
    title="Intermittent control: a dead zone around the reference",
    ledger="control",
    equation=r"k_1 f(x - d), \quad f(e) = 0 \text{ for } |e| < x_0",
    source="burst control around an uncertainty area, Bottaro 2008; Asai 2009",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("half_width", "m", 0.0, 0.08, matters=0.003),),
    confounded=(),
    separated="sway beyond the zone on both sides",
    law=tuple(Term(stage, f, STARTS, (1e-3,), framewise=True) for stage, f in (("place", soft), ("place", jump), ("out", hold))),
)
