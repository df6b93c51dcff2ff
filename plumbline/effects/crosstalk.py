"""The CoP was computed in a plane above or below the one the foot stands on."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """-w2 F/(m g) [per m]: the recorded p is p - height F/Fz."""
    return np.asarray((-c.w2 * c.grf_x / (c.mass * c.g))[:, None])


EFFECT = Effect(
    title="CoP in another plane than the contact",
    ledger="plant",
    equation=r"-\omega^2 h_p \frac{F_x}{F_z}",
    source="balance of moments of a plate whose surface lies h_p above the plane of the CoP: p - h_p Fx/Fz is recorded",
    needs=("grf_x", "zmp_x"),
    parameters=(Parameter("height", "m", -0.06, 0.06),),
    confounded=("inertia",),
    separated="a tilted rod on the plate; the plate's geometry: a fitted w2 takes all of it",
    columns=columns,
    twin="w2",
    recorded=True,
)
