"""The plates record a CoP that is shifted."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """w2 [per m]."""
    return np.full((len(c.time), 1), c.w2)


EFFECT = Effect(
    title="CoP shifted by a constant",
    ledger="plant",
    equation=r"\omega^2 b",
    source="definition: p recorded as p + b",
    needs=("zmp_x",),
    parameters=(Parameter("b", "m", -0.1, 0.1),),
    confounded=("com_bias", "tilt", "hand_zero"),
    separated="the CoP of each plate against the markers of its foot; an empty plate; static poses in several places",
    columns=columns,
    recorded=True,
)
