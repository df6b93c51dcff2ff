"""The measured shear in place of the markers' acceleration."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """x'' - F/m [per 1]: with the whole of it the equation reads F/m = w2 (x - p)."""
    return np.asarray((c.com_x_ddot - c.grf_x / c.mass)[:, None])


EFFECT = Effect(
    title="Acceleration by the shear, not by the markers",
    ledger="plant",
    equation=r"s\,(\ddot x - F_x/m)",
    source="Newton: x'' = F/m; Gonzalez 2014 for how far tables are off",
    needs=("com_x", "grf_x"),
    parameters=(Parameter("s", "1", 0.0, 2.0, physics=1.0, within=0.2),),
    separated="the personal centre of mass; markers on bone",
    columns=columns,
    force=columns,
    recorded=True,
    searched=False,
)
