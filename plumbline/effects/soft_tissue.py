"""Markers wobble on soft tissue."""

import numpy as np

from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter


def columns(c: Channels) -> Array:
    """(w2 F - F'')/m [per s2]: x recorded as x + n, n = -x''/W^2 below its resonance W."""
    return np.asarray(((c.w2 * c.grf_x - c.grf_x_ddot) / c.mass)[:, None])


def force(c: Channels) -> Array:
    """-F''/m [per s2]."""
    return np.asarray((-c.grf_x_ddot / c.mass)[:, None])


def values(theta: Array, constant: float) -> Array:
    """Frequency of the wobble [Hz] from 1/W^2 [s2]."""
    return np.sqrt(1.0 / np.where(theta > 0, theta, np.nan)) / (2.0 * np.pi)


def undo(c: Channels, values: Array) -> Channels:
    """The CoM of the bones, to first order: frames without shear stay as they are."""
    return c.changed(com_x=c.com_x + np.nan_to_num(c.grf_x) / c.mass / (2.0 * np.pi * float(values[0])) ** 2)


EFFECT = Effect(
    title="Soft tissue",
    ledger="plant",
    equation=r"\frac{1}{W^2}\left(\omega^2 \ddot x - x^{(4)}\right), \qquad \text{kinematic: } -\frac{x^{(4)}}{W^2}",
    source="n'' + 2 s W n' + W^2 n = -x'', below its resonance; Le Mouel 2025",
    needs=("com_x", "grf_x"),
    parameters=(Parameter("frequency", "Hz", 1.5, 15.0),),
    confounded=("filter",),
    separated="several marker sets; markers on bone",
    columns=columns,
    force=force,
    values=values,
    undo=undo,
    recorded=True,
)
