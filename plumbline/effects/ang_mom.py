"""Segments turn about the CoM."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """L'/(m z) [m/s2]."""
    return np.asarray((c.ang_mom_dot / (c.mass * c.height))[:, None])


EFFECT = Effect(
    title="Angular momentum about the CoM",
    ledger="plant",
    equation=r"\beta\,\frac{\dot L}{m z}",
    source="balance of moments about the CoM; van den Bogaart 2023, Hof 2007",
    needs=("ang_mom", "com_z"),
    parameters=(Parameter("beta", "1", -2.0, 0.0, physics=-1.0, within=0.35),),
    confounded=("com_bias",),
    separated="counter-rotation of trunk or arms with little motion of the CoM",
    columns=columns,
)
