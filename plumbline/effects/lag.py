"""The ZMP follows the law's command like muscles do: first order, with the limits before or behind."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def follow(p: Array, now: Now, sizes: Sizes) -> Array:
    """ZMP one frame on its way to the command p [m]."""
    return np.asarray(now.kept + (1 - np.exp(-now.step / np.maximum(sizes[0], 1e-6))) * (p - now.kept))


STARTS = ((0.03,), (0.08,), (0.14,))

EFFECT = Effect(
    title="Lag between command and ZMP",
    ledger="control",
    equation=r"T \dot p + p = \mathrm{cmd}",
    source="Masani 2008: second order, T = 0.152 s; first order here",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("time", "s", 0.0, 0.4, matters=0.02),),
    confounded=("delay",),
    separated="a sudden push: does the ZMP answer late, or at once but slowly?",
    law=(Term("out", follow, STARTS, (2e-3,)), Term("asked", follow, STARTS, (2e-3,))),
)
