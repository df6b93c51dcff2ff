"""One side was filtered by a causal filter, or with another cut-off."""

import numpy as np

from plumbline.batch import slow
from plumbline.effects._channels import Array, Channels
from plumbline.effects._effect import Effect, Parameter
from plumbline.filters import runs

RECORD = ("grf_x", "grf_y", "grf_z", "zmp_x", "zmp_y")
SHORT = 4  # frames, of which nothing is given back
BEND = 10.0  # [Hz] smoother of what is given back: two derivatives of noise would drown it, and limits are sharp


def columns(c: Channels) -> Array:
    """-w2 p' [per s]: to second order a causal Butterworth of second order is nothing but a delay of sqrt(2)/(2 pi cut-off)."""
    return np.asarray((-c.w2 * c.zmp_x_dot)[:, None])


def force(c: Channels) -> Array:
    """F'/m [per s]."""
    return np.asarray((c.grf_x_dot / c.mass)[:, None])


def undo(c: Channels, values: Array) -> Channels:
    """The force record before a Butterworth filter of second order: 1/H = 1 + tau s + (tau s)^2 / 2, up to BEND."""
    tau = float(values[0])

    def lost(name: str) -> Array:
        y = tau * c[f"{name}_dot"] + tau**2 / 2 * c[f"{name}_ddot"]
        for a, b in runs(np.isfinite(y)):
            y[a:b] = slow(y[a:b], c.rate, BEND) if b - a > SHORT else 0.0
        return y

    return c.changed(**{k: c[k] + lost(k) for k in RECORD if c.has(k)})


EFFECT = Effect(
    title="Force record filtered by a causal filter",
    ledger="plant",
    equation=r"-\omega^2 \tau\,\dot p, \qquad \text{kinematic: } \tau\,\dot F_x/m",
    source="transfer function of a causal low-pass, first order in its group delay",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("delay", "s", 0.0, 0.2, matters=0.003),),
    confounded=("sync", "soft_tissue"),
    separated="the raw, unfiltered force record: white noise up to its highest frequency rules a filter out",
    columns=columns,
    force=force,
    undo=undo,
    twin="sync",
    recorded=True,
)
