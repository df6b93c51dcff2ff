"""A contact that no plate measures: a seat, a box, a person."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """Load Fez = m (z'' + g) - Fz and shear Fex = m x'' - Fx: p Fez/(m z), -Fez/(m z) [per m], Fex/(m z) [per m]."""
    load = (c.com_z_ddot + c.g - c.grf_z / c.mass) / c.height
    shear = (c.com_x_ddot - c.grf_x / c.mass) / c.height
    return np.column_stack([c.zmp_x * load, -load, shear])


EFFECT = Effect(
    title="Contact that no plate measures",
    ledger="plant",
    equation=r"\frac{h_e F_{ex} - (x_e - p) F_{ez}}{m z}, \quad F_e = m(\ddot r + g) - F",
    source="balance of moments with an outer force; its size from the balance of forces",
    needs=("com_x", "com_z", "grf_x", "grf_z", "zmp_x"),
    parameters=(
        Parameter("force", "N", -3000.0, 3000.0),
        Parameter("x", "m", -3.0, 3.0),
        Parameter("lateral", "N", -1000.0, 1000.0),
        Parameter("height", "m", -1.0, 3.0),
    ),
    confounded=("hand",),
    separated="a load cell in the contact, or the same task without it",
    columns=columns,
)
