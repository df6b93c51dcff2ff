"""The ZMP nears its limits by a soft knee instead of a sharp one."""

import numpy as np

from plumbline.effects._effect import Effect, Parameter
from plumbline.models.loop import Array, Now, Sizes, Term

FLAT = 40.0  # [1] knees beyond the box where it is flat to all digits


def rounded(p: Array, now: Now, sizes: Sizes) -> Array:
    """The ZMP asked for [m] in a box whose corners are rounded: slope 1 well inside, 0 well outside.

    The box reaches further than the limits seen: a soft knee is never walked to its end.
    """
    knee = np.maximum(sizes[0], 1e-9)
    low, high = now.limits[0] - sizes[1], now.limits[1] + sizes[1]
    soft = low + knee * (np.logaddexp(0.0, (p - low) / knee) - np.logaddexp(0.0, (p - high) / knee))
    flat = (p < low - FLAT * knee) | (p > high + FLAT * knee)
    return np.where(flat, p, soft)  # there the loop's own limits act, and know that they do


EFFECT = Effect(
    title="Soft limits of the ZMP",
    ledger="control",
    equation=r"\mathrm{clip} \to \text{a smooth box with a knee of width } s",
    source="this file; no paper. Feedback noise of 4 mm ahead of sharp limits rounds them by 2 mm in the same way",
    needs=("com_x", "zmp_x"),
    parameters=(Parameter("knee", "m", 0.0, 0.1, matters=0.006), Parameter("beyond", "m", 0.0, 0.05)),
    confounded=("lag", "sensory"),
    separated="slow leans to both limits; pressure under the edge of each foot",
    law=(Term("asked", rounded, ((0.005, 0.0), (0.02, 0.005)), (1e-3, 1e-4)),),
)
