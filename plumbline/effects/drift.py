"""The recorded CoP drifts within a trial."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """w2 t [per m/s], t from the trial's start."""
    return np.asarray((c.w2 * c.time)[:, None])


EFFECT = Effect(
    title="CoP drifts",
    ledger="plant",
    equation=r"\omega^2 c\,t",
    source="definition: p recorded as p + c t, t from the start of the trial",
    needs=("zmp_x",),
    parameters=(Parameter("c", "m/s", -0.01, 0.01),),
    confounded=(),
    separated="the plate empty before and after",
    columns=columns,
    recorded=True,
)
