r"""Phase portrait of the closed loop, x'' = w2 (x - p), p = clip(d + k1 (x - d) + k2 x') (Murai 2013, eq. 6), as a table.

Parts: `field`, the vector (x', x'') on a grid; `flow`, trajectories from the border of the box inwards; `region`, the lines on which
the law asks for a limit: between them S2, to the left S1 (ZMP at its left limit), to the right S3; `separatrix`, the trajectories that
end in the two saddle points (a CoM at rest over a limit): what starts outside of them falls.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.models.com_zmp import com_acceleration
from plumbline.models.controller import Law

Array = NDArray[np.float64]

BOX = (0.31, 0.70)  # [m], [m/s] half width and half height about the reference
GRID = (21, 17)
STARTS = 12  # trajectories that enter over each side of the box
STEP = 0.005  # [s]
LONGEST = 4.0  # [s]
LAW = ["reference", "k1", "k2", "limit_left", "limit_right"]
COLUMNS = ["condition", "cluster", "omega", "part", "line", "x", "v", "vx", "vv"]


def of_controller(rows: pd.DataFrame) -> pd.DataFrame:
    """Portraits of several rows of table `controller` (those of `values.groups`) with both limits: :data:`COLUMNS`.

    x [m], v [m/s]; in part `field` also vx [m/s], vv [m/s2].  omega [rad/s]: of the portrait.
    """
    parts = []
    for condition, cluster, omega, *law in rows[["condition", "cluster", "omega", *LAW]].itertuples(index=False, name=None):
        if np.isfinite([omega, *law]).all():
            about = {"condition": condition, "cluster": cluster, "omega": omega}
            parts.append(portrait(Law(*law), omega).assign(**about))
    return pd.concat(parts, ignore_index=True)[COLUMNS] if parts else pd.DataFrame(columns=COLUMNS)


def portrait(law: Law, omega: float) -> pd.DataFrame:
    """One portrait.  law: with finite limits.  omega [rad/s]."""
    lines = [*_field(law, omega), *_flow(law, omega), *_regions(law), *_separatrices(law, omega)]
    return pd.concat(lines, ignore_index=True)


def slope(state: Array, law: Law, omega: float) -> Array:
    """(x', x'') of the closed loop (eq. 6).  state: (x, x'), shape (2, ...)."""
    return np.stack([state[1], com_acceleration(state[0], law.zmp(state[0], state[1]), omega**2)])


def _field(law: Law, omega: float) -> Iterator[pd.DataFrame]:
    x, v = np.meshgrid(law.d + np.linspace(-1, 1, GRID[0]) * BOX[0], np.linspace(-1, 1, GRID[1]) * BOX[1])
    vx, vv = slope(np.stack([x, v]), law, omega)
    yield pd.DataFrame({"part": "field", "line": 0, "x": x.ravel(), "v": v.ravel(), "vx": vx.ravel(), "vv": vv.ravel()})


def _flow(law: Law, omega: float) -> Iterator[pd.DataFrame]:
    """Trajectories forward in time from where the flow enters the box."""
    s = np.linspace(-1, 1, STARTS)
    edge = [(s, np.full_like(s, side)) for side in (-1.0, 1.0)] + [(np.full_like(s, side), s) for side in (-1.0, 1.0)]
    state = np.concatenate(edge, axis=1) * np.array(BOX)[:, None] + np.array([law.d, 0.0])[:, None]
    moved = state + 1e-6 * slope(state, law, omega)
    yield from _lines("flow", _integrate(state[:, _in_box(moved, law)], law, omega, STEP))


def _regions(law: Law) -> Iterator[pd.DataFrame]:
    """Lines d + k1 (x - d) + k2 x' = limit."""
    v = np.array([-BOX[1], BOX[1]])
    for line, limit in enumerate((law.left, law.right)):
        yield pd.DataFrame({"part": "region", "line": line, "x": law.d + (limit - law.d - law.k2 * v) / law.k1, "v": v})


def _separatrices(law: Law, omega: float) -> Iterator[pd.DataFrame]:
    """Backward in time from each saddle point (x at the limit, at rest) along its stable direction (1, -omega), both ways."""
    limits, ways = np.repeat([law.left, law.right], 2), np.array([-1.0, 1.0, -1.0, 1.0])
    start = np.stack([limits + 1e-4 * ways, -1e-4 * omega * ways])
    yield from _lines("separatrix", _integrate(start, law, omega, -STEP))


def _integrate(state: Array, law: Law, omega: float, step: float) -> Array:
    """Fourth-order Runge-Kutta; (steps + 1, 2, lines), NaN after a line has left the box."""
    out = [state]
    for _ in range(round(LONGEST / abs(step))):
        a = slope(state, law, omega)
        b = slope(state + step / 2 * a, law, omega)
        c = slope(state + step / 2 * b, law, omega)
        state = state + step / 6 * (a + 2 * b + 2 * c + slope(state + step * c, law, omega))
        state = np.where(_in_box(state, law), state, np.nan)
        out.append(state)
    return np.stack(out)


def _in_box(state: Array, law: Law) -> NDArray[np.bool_]:
    return np.asarray((np.abs(state[0] - law.d) <= BOX[0]) & (np.abs(state[1]) <= BOX[1]))


def _lines(part: str, states: Array) -> Iterator[pd.DataFrame]:
    for line in range(states.shape[2]):
        x, v = states[:, 0, line], states[:, 1, line]
        good = np.isfinite(x)
        yield pd.DataFrame({"part": part, "line": line, "x": x[good], "v": v[good]})
