"""One side was filtered by a causal filter, or with another cut-off."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """-w2 p' [per s]: to second order a causal Butterworth of second order is nothing but a delay of sqrt(2)/(2 pi cut-off)."""
    return np.asarray((-c.w2 * c.zmp_x_dot)[:, None])


def force(c: Channels) -> Array:
    """F'/m [per s]."""
    return np.asarray((c.grf_x_dot / c.mass)[:, None])


EFFECT = Effect(
    title="Force record filtered by a causal filter",
    ledger="plant",
    equation=r"-\omega^2 \tau\,\dot p, \qquad \text{kinematic: } \tau\,\dot F_x/m",
    source="transfer function of a causal low-pass, first order in its group delay",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("delay", "s", 0.0, 0.2, matters=0.003),),
    confounded=("sync", "soft_tissue"),
    separated="the raw, unfiltered force record: white noise up to its highest frequency rules a filter out",
    columns=columns,
    force=force,
    twin="sync",
    recorded=True,
)
