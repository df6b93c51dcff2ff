"""The law also acts on the integral of the deviation."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def added(now: Now, sizes: Sizes) -> Array:
    """ki times the integral of x - d since the record began [m]; d counts whole, the CoM before the locus as measured."""
    d = now.seen[0] - now.far
    return np.asarray(sizes[0] * (now.area + now.swept - d * now.time))


EFFECT = Effect(
    title="Integral action",
    ledger="control",
    equation=r"+\,k_i \int (x - d)\,dt",
    source="the usual remedy of a control engineer for a lasting deviation",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("ki", "1/s", -2.0, 2.0, matters=0.05),),
    confounded=("ref_drift",),
    separated="a step of the visual target; a lasting sideways pull",
    law=(Term("added", added, ((0.0,),), (1e-3,)),),
)
