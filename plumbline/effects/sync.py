"""The force record is late (or early) against the markers."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter

LATE = ("grf_x", "grf_y", "grf_z", "zmp_x", "zmp_y")


def columns(c: Channels) -> Array:
    """-w2 p' [per s]."""
    return np.asarray((-c.w2 * c.zmp_x_dot)[:, None])


def force(c: Channels) -> Array:
    """F'/m [per s]: what was recorded is F(t - delay)."""
    return np.asarray((c.grf_x_dot / c.mass)[:, None])


def vertical(c: Channels) -> Array:
    """Fz'/m [per s]."""
    return np.asarray((c.grf_z_dot / c.mass)[:, None])


def undo(c: Channels, values: Array) -> Channels:
    """The force record put back in time."""
    return c.shifted(LATE, float(values[0]))


EFFECT = Effect(
    title="Force record late against the markers",
    ledger="plant",
    equation=r"-\omega^2 D\,\dot p, \qquad \text{kinematic: } D\,\dot F_x/m",
    source="p(t) recorded as p(t - D), first order in D; van den Bogert 2000, Lemaire and Kuo 2024",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("delay", "s", -0.2, 0.2, matters=0.003),),
    confounded=("filter",),
    separated="a tap on a plate with a marker on the hammer",
    columns=columns,
    force=force,
    vertical=vertical,
    undo=undo,
    settled=True,
    recorded=True,
)
