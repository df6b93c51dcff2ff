"""The ZMP follows the law's command like muscles do: first order, with the limits before or behind."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def follow(p: Array, now: Now, sizes: Sizes) -> Array:
    """ZMP one frame on its way to the command p [m], exact for a command that is straight between frames."""
    time = np.maximum(sizes[0], 1e-12) / now.step
    left = np.exp(-1 / time)
    mean = time * (1 - left)  # weight of the command over the frame, its end excluded
    return np.asarray(left * now.kept + (mean - left) * now.before + (1 - mean) * p)


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
