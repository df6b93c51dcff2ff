"""A hold on something fixed, not measured: a spring to a place."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """Moment of the spring: -x/(m z) per k he [N]; the part of its place is a constant, which is always fitted."""
    return np.column_stack([np.zeros_like(c.com_x), -c.com_x / (c.mass * c.height)])


def force(c: Channels) -> Array:
    """Its force over the mass: -x/m per k [N/m]."""
    return np.column_stack([-c.com_x / c.mass, np.zeros_like(c.com_x)])


def values(theta: Array, constant: float) -> Array:
    """k [N/m], height [m], and the place x [m] from the constant of the kinematic side [N]."""
    k, k_he = theta
    return np.array([k, k_he / k, constant / k])


EFFECT = Effect(
    title="Hand on something fixed",
    ledger="plant",
    equation=r"-\frac{k_h h_e}{m z}(x - x_h), \qquad \text{kinematic: } -\frac{k_h}{m}(x - x_h)",
    source="balance of moments and forces with a spring; Rabin 1999, Jeka and Lackner 1994",
    needs=("com_x", "grf_x", "com_z"),
    parameters=(
        Parameter("k", "N/m", 2.0, 3000.0),
        Parameter("height", "m", 0.0, 2.5),
        Parameter("x", "m", -5.0, 5.0),
    ),
    confounded=("com_bias", "force_scale", "gain", "push"),
    separated="a load cell under the hand, or trials without it",
    columns=columns,
    force=force,
    values=values,
)
