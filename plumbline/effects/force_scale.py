"""The plates' forces are too large by a factor, the CoP is right."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """Nothing: neither x nor p changes."""
    return np.zeros((len(c.time), 1))


def force(c: Channels) -> Array:
    """-F/m [per s/(1 + s)], F as recorded."""
    return np.asarray((-c.grf_x / c.mass)[:, None])


def values(theta: Array, constant: float) -> Array:
    """s from its share of the recorded force."""
    return np.asarray(theta / (1.0 - theta))


EFFECT = Effect(
    title="Forces too large by a factor",
    ledger="plant",
    equation=r"0, \qquad \text{kinematic: } -\frac{s}{1 + s}\,F_x/m",
    source="F recorded as (1 + s) F, or a body mass that is wrong",
    needs=("grf_x", "com_x"),
    parameters=(Parameter("s", "1", -0.3, 0.3, matters=0.015),),
    confounded=("com_bias", "gain", "hand"),
    separated="a static trial on a balance; the vertical equation",
    columns=columns,
    force=force,
    values=values,
    recorded=True,
)
