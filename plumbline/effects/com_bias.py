"""The CoM from markers is scaled and shifted."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """-w2 (p - middle) [per 1]: the scale is counted from where the person is, not from the laboratory's origin."""
    return np.asarray((-c.w2 * (c.zmp_x - c.middle))[:, None])


def force(c: Channels) -> Array:
    """F/m [per 1]."""
    return np.asarray((c.grf_x / c.mass)[:, None])


def undo(c: Channels, values: Array) -> Channels:
    """The CoM as it is."""
    return c.changed(com_x=c.middle + (c.com_x - c.middle) / (1.0 + float(values[0])))


EFFECT = Effect(
    title="CoM scaled or shifted",
    ledger="plant",
    equation=r"-\omega^2 (a\,p + e_0), \qquad \text{kinematic: } a\,F_x/m",
    source="x recorded as (1 + a) x + e0; Gonzalez 2014: tables 24.9 mm off in seven people",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("scale", "1", -0.3, 0.3, matters=0.015), Parameter("e0", "m", -0.1, 0.1)),
    confounded=("gain", "offset", "tilt", "force_scale", "hand", "ang_mom", "height"),
    separated="static poses in many places (x = p), with the CoP checked by a known load",
    columns=columns,
    force=force,
    undo=undo,
    settled=True,
    recorded=True,
)
