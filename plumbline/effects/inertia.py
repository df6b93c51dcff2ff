"""The body leans as one piece and has a moment of inertia."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """-w2/(m z^2) (x - p) [per kg m2]: a rigid lean L = I x'/z lowers w2 to w2/(1 + I/(m z^2)), here to first order."""
    return np.asarray((-c.w2 / (c.mass * c.height**2) * (c.com_x - c.zmp_x))[:, None])


EFFECT = Effect(
    title="Moment of inertia of a rigid lean",
    ledger="plant",
    equation=r"-\frac{I}{m z^2}\,\omega^2 (x - p)",
    source="angular momentum L = I x'/z of a rigid lean in the balance of moments; first order in I/(m z^2)",
    needs=("com_x", "com_z", "zmp_x"),
    parameters=(Parameter("moment", "kg m2", 0.0, 40.0),),
    confounded=("crosstalk",),
    separated="a measured push, with its coefficient fixed; and the height of the CoM: a fitted w2 takes all of it",
    columns=columns,
    twin="w2",
)
