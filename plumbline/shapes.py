"""Shapes without a cause: what a residual may look like when no effect of the catalogue explains it.

They compete with the effects so that a soft wall is not taken for a spring, but are never named: a verdict that needs one says
`unexplained` and describes it. Same contract as an effect. Forces from outside have an unknown height: two columns each.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from plumbline.effects import Channels, Effect, Parameter

Array = NDArray[np.float64]
Shape = Callable[[Channels], Array]

EDGE = 0.7  # share of the reach at which a wall or an edge of the foot begins to be felt


def _from_middle(values: Array) -> tuple[Array, float]:
    """A channel from its median, and its reach (97th percentile of the distance)."""
    centred = values - np.nanmedian(values)
    return centred, float(np.nanquantile(np.abs(centred), 0.97))


def _outer(shape: Shape, *, own: bool = False) -> tuple[Shape, Shape]:
    """Columns and force of an outer force of this shape [N] at an unknown height."""

    def columns(c: Channels) -> Array:
        pull = shape(c)
        return np.column_stack([np.zeros_like(pull), pull / (c.mass * c.height)])

    def force(c: Channels) -> Array:
        pull = shape(c)
        return np.column_stack([pull / c.mass, np.zeros_like(pull)])

    return columns, force


def _cubic(c: Channels) -> Array:
    x, reach = _from_middle(c.com_x)
    return np.asarray(-((x / reach) ** 3))


def _wall_right(c: Channels) -> Array:
    x, reach = _from_middle(c.com_x)
    return np.asarray(-np.clip(x / reach - EDGE, 0, None))


def _wall_left(c: Channels) -> Array:
    x, reach = _from_middle(c.com_x)
    return np.clip(-x / reach - EDGE, 0, None)


def _damper(c: Channels) -> Array:
    return -c.com_x_dot


def _cop(power: int) -> Shape:
    def columns(c: Channels) -> Array:
        p, reach = _from_middle(c.zmp_x)
        return np.asarray((c.w2 * reach * (p / reach) ** power)[:, None])

    return columns


def _cop_edge(c: Channels) -> Array:
    p, reach = _from_middle(c.zmp_x)
    out = c.w2 * reach * np.column_stack([np.clip(p / reach - EDGE, 0, None), np.clip(-p / reach - EDGE, 0, None)])
    return np.asarray(out)


def _viscous(c: Channels) -> Array:
    return np.asarray((c.w2 * c.com_x_dot)[:, None])


def _posed(c: Channels) -> Array:
    return np.asarray((c.ang_mom_dot / (c.mass * c.height))[:, None])


def _shape(title: str, equation: str, needs: tuple[str, ...], columns: Shape, force: Shape | None = None, count: int = 1) -> Effect:
    numbers = tuple(Parameter(f"c{k}", "") for k in range(count))
    return Effect(title, "plant", equation, "this file; a shape, not a cause", needs, numbers, columns, force)


_KIN = ("com_x", "grf_x", "com_z")
SHAPES: dict[str, Effect] = {
    "~damper": _shape("a force against the velocity", r"-b\,\dot x", _KIN, *_outer(_damper), count=2),
    "~cubic": _shape("a force that grows with the cube of the CoM", r"-c\,x^3", _KIN, *_outer(_cubic), count=2),
    "~wall_right": _shape("a force from a place on the right on", r"-k\,(x - x_r)_+", _KIN, *_outer(_wall_right), count=2),
    "~wall_left": _shape("a force from a place on the left on", r"k\,(x_l - x)_+", _KIN, *_outer(_wall_left), count=2),
    "~cop_cubic": _shape("a CoP that is not linear (cubic)", r"\omega^2 c\,p^3", ("com_x", "zmp_x"), _cop(3)),
    "~cop_fifth": _shape("a CoP that is not linear (fifth power)", r"\omega^2 c\,p^5", ("com_x", "zmp_x"), _cop(5)),
    "~cop_edge": _shape("a CoP that is not linear (edges)", r"\omega^2 c\,(|p| - p_0)_+", ("com_x", "zmp_x"), _cop_edge, count=2),
    "~viscous": _shape("a moment against the velocity", r"\omega^2 c\,\dot x", ("com_x", "zmp_x"), _viscous),
}  # fmt: skip
SHAPES["~pose"] = _shape(
    "a segment table whose CoM errs as the trunk rolls", r"e\,\ddot\varphi", ("com_x", "grf_x", "ang_mom", "com_z"), _posed, _posed
)
BESIDE = {"~pose": "ang_mom"}
"""Faults of the same measurement as an effect: they may stand beside it, and only there, without anything being unexplained."""
PLACED = ("~cubic", "~wall_right", "~wall_left", "~cop_edge")
"""Shapes that begin or grow from a place: it stands in the constants too."""
