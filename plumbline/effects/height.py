"""The height of the CoM and its acceleration change with time."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """w2 (w(t)/w0 - 1) (x - p) with w(t) = (z'' + g)/z, w0 the person's; the plates measure z'' + g better than the markers."""
    push = c.grf_z / c.mass if c.has("grf_z") else c.com_z_ddot + c.g
    w = push / c.com_z
    return np.asarray((c.w2 * (w * c.height / c.g - 1.0) * (c.com_x - c.zmp_x))[:, None])


EFFECT = Effect(
    title="Height of the CoM changes",
    ledger="plant",
    equation=r"\beta\,\omega^2 \left(\frac{w(t)}{\bar w} - 1\right)(x - p), \quad w = (\ddot z + g)/z",
    source="Murai 2013, eq. 2, with z(t) in place of its mean",
    needs=("com_x", "com_z", "zmp_x"),
    parameters=(Parameter("beta", "1", 0.0, 2.0, physics=1.0, within=0.6),),
    confounded=("com_bias",),
    separated="slow squats, with the vertical force measured",
    columns=columns,
)
