"""The recorded CoP is too large by a factor."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """w2 p [per q/(1 + q)], p as recorded."""
    return np.asarray((c.w2 * c.zmp_x)[:, None])


def values(theta: Array, constant: float) -> Array:
    """q from its share of the recorded p."""
    return np.asarray(theta / (1.0 - theta))


def undo(c: Channels, values: Array) -> Channels:
    """The CoP as it was."""
    return c.changed(zmp_x=c.zmp_x / (1.0 + float(values[0])))


EFFECT = Effect(
    title="CoP too large by a factor",
    ledger="plant",
    equation=r"\omega^2 q\,p",
    source="p recorded as (1 + q) p; sizes: non-linear plate re-calibration, Gait Posture 2011",
    needs=("zmp_x",),
    parameters=(Parameter("q", "1", -0.3, 0.3, matters=0.01),),
    confounded=("com_bias", "force_scale", "hand"),
    separated="a known load at known places of the plate; the shear force beside the markers",
    columns=columns,
    values=values,
    undo=undo,
    recorded=True,
)
