"""The CoM is the person's own, not the segment table's."""

import numpy as np

from plumbline.effects._channels import Array, Channels, derivative
from plumbline.effects._effect import Effect, Parameter


def _off(c: Channels, axis: str) -> Array:
    """Table less own CoM, told by the subject's other trials [m]."""
    return np.asarray(c[f"com_table_{axis}"] - c[f"com_others_{axis}"])


def columns(c: Channels) -> Array:
    """d'' - w2 d [per 1], d: how far the table's CoM is from the person's own."""
    return np.asarray((derivative(_off(c, "x"), c.rate, 2) - c.w2 * _off(c, "x"))[:, None])


def force(c: Channels) -> Array:
    """d'' [per 1]."""
    return np.asarray(derivative(_off(c, "x"), c.rate, 2)[:, None])


def vertical(c: Channels) -> Array:
    """The same of the height [per 1]."""
    return np.asarray(derivative(_off(c, "z"), c.rate, 2)[:, None])


def undo(c: Channels, values: Array) -> Channels:
    """The person's own CoM in the place of the table's."""
    share = float(values[0])
    return c.changed(com_x=c.com_x - share * _off(c, "x"), com_z=c.com_z - share * _off(c, "z"))


EFFECT = Effect(
    title="CoM of the person's own chain",
    ledger="plant",
    equation=r"s\,(\ddot d - \omega^2 d), \qquad d = x_{table} - x_{own}; \quad \text{kinematic: } s\,\ddot d",
    source="Gonzalez 2013 (SESC), fitted on the subject's other trials; Gonzalez 2014: tables 24.9 mm off in seven people",
    needs=("com_table_x", "com_others_x", "com_others_z", "zmp_x"),
    parameters=(Parameter("s", "1", 0.0, 2.0, physics=1.0, within=0.3),),
    separated="still poses that differ as much as the motion does; the same subject in other tasks",
    columns=columns,
    force=force,
    vertical=vertical,
    undo=undo,
    recorded=True,
    searched=False,
)
