"""The floor of the plates is not level."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """g [m/s2 per rad]."""
    return np.full((len(c.time), 1), c.g)


def force(c: Channels) -> Array:
    """g [m/s2 per rad]: weight has a part along the plate; an error of the shear's zero looks the same here."""
    return np.full((len(c.time), 1), c.g)


EFFECT = Effect(
    title="Floor not level",
    ledger="plant",
    equation=r"g\,\alpha, \qquad \text{kinematic: } g\,\alpha",
    source="coordinates turned by a small angle: a CoM at height z moves by z alpha against the CoP",
    needs=("com_x", "zmp_x", "grf_x"),
    parameters=(Parameter("angle", "rad", -0.1, 0.1),),
    confounded=("offset", "com_bias", "hand_zero"),
    separated="a level; the same stance turned by half a turn",
    columns=columns,
    force=force,
    recorded=True,
)
