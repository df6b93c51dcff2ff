"""The sensor under a hand or a seat reads a constant force too much."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """-w2 hz/Fz, w2 (hx - p)/Fz [per N]: the recorded p is p + (fz (hx - p) - fx hz)/Fz."""
    return np.column_stack([-c.w2 * c.hand_z / c.grf_z, c.w2 * (c.hand_x - c.zmp_x) / c.grf_z])


def force(c: Channels) -> Array:
    """-1/m, 0 [per N]: the recorded F is larger by fx."""
    return np.column_stack([np.full(len(c.time), -1.0 / c.mass), np.zeros(len(c.time))])


def vertical(c: Channels) -> Array:
    """0, -1/m [per N]."""
    return force(c)[:, ::-1]


EFFECT = Effect(
    title="Zero error of a hand's or a seat's sensor",
    ledger="plant",
    equation=r"\omega^2 \frac{f_z (h - p) - f_x h_z}{F_z}, \qquad \text{kinematic: } -\frac{f_x}{m}",
    source="balance of moments of a load f at (h, h_z) that is recorded and does not act",
    needs=("hand_x", "hand_z", "zmp_x", "grf_x", "grf_z"),
    parameters=(Parameter("lateral", "N", -50.0, 50.0, matters=1.0), Parameter("load", "N", -50.0, 50.0, matters=1.0)),
    confounded=("offset", "tilt"),
    separated="the sensor's reading with the hand off it; handles at several heights",
    columns=columns,
    force=force,
    vertical=vertical,
    recorded=True,
    searched=False,  # no cohort with handles tells how often a search would name it wrongly
)
