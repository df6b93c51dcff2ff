"""The position that the person returns to moves while the record runs."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def reference(now: Now, sizes: Sizes) -> Array:
    """Shift of d since the record began [m]."""
    return np.asarray(sizes[0] * now.time)


EFFECT = Effect(
    title="Drift of the reference",
    ledger="control",
    equation=r"d(t) = d + c\,t, \qquad +(1 - k_1)\, c\, t",
    source="slow sway modes, Kiemel 2006; a straight line over one record here",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("rate", "m/s", -0.02, 0.02, matters=2e-4),),
    confounded=("integral",),
    separated="a step of the visual target; longer records",
    law=(Term("reference", reference, ((0.0,),), (1e-5,)),),
)
