"""Stiffness and damping of the body itself, which act without the nerves' delay."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term


def added(now: Now, sizes: Sizes) -> Array:
    """kappa x + beta x', as far as it is not in the delayed law already [m]."""
    return np.asarray(sizes[0] * (now.x - now.seen[0]) + sizes[1] * (now.v - now.seen[1]))


EFFECT = Effect(
    title="Intrinsic stiffness and damping",
    ledger="control",
    equation=r"+\,\kappa\,(x - x(t - D)) + \beta\,(\dot x - \dot x(t - D))",
    source="kappa = K/(m g z) = 0.91 +- 0.23, sagittal ankle: Loram and Lakie 2002",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("kappa", "1", 0.0, 3.0, matters=0.1), Parameter("beta", "s", 0.0, 0.6, matters=0.03)),
    confounded=("delay", "lag"),
    separated="pushes of many sizes beside a known delay; without a delay it is part of k1 and k2",
    law=(Term("added", added, ((0.5, 0.1),), (1e-3, 1e-3), beside=("delay",)),),
)
