r"""How a person's CoM can differ from the segment table's: the parameters of a chain, their effect in each pose, their spread.

With mass shares :math:`\mu_s` and segment CoMs :math:`r_s`, :math:`c = \sum \mu_s r_s / \sum \mu_s`. To first order

.. math:: \delta c = \sum_s \mu_s (r_s - c)\,\delta\ln\mu_s + \mu_s A_s\,\delta r_s ,

so that shares always sum to one. In a body of rigid segments this spans the same space as the parameters of the statically
equivalent serial chain (Gonzalez 2013, eq. 6); it needs no link lengths, holds for joints that give way, and says what a number means.

A segment known by two points has axes :math:`u` (proximal to distal), and the part of the body's lateral axis across it.

Spreads: masses 10 %, the CoM of a limb 2.5 % of its length along and 6 mm off in any direction across, of the trunk 12, 3, 18 mm
forward, lateral, up:
the size by which the tables of Dempster (1955), Clauser (1969), Zatsiorsky (1983, as in de Leva 1996) and people measured by DXA
(Durkin and Dowling 2003) differ; left from right by 3 %. Beside the segments the whole CoM may lie 10 mm further forward and 3 mm to
the side in any pose, in the body's heading: tables of standing people are off by 3 to 25 mm in a direction that does not turn with
any one segment (flesh in front of the joints' axes, feet that the chain has not).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.body import Body
from plumbline.models.sesc import Prior

Array = NDArray[np.float64]

MASS, SIDES, ALONG, ACROSS = 0.10, 0.03, 0.025, 0.0042  # [1], [1], [1] of the length, [m] each way
TRUNK = {"forward": 0.012, "lateral": 0.003, "up": 0.018}  # [m]
WHOLE = {"forward": 0.010, "lateral": 0.003}  # [m]
UP = np.array([0.0, 0.0, 1.0])
LATERAL = np.array([1.0, 0.0, 0.0])  # pipeline axes: the subject's left-to-right direction
SMALL = 0.1  # [m] shorter than that no direction is taken from two points


@dataclass(frozen=True)
class Parameter:
    """One way in which a person differs from the table.  sd: its spread in `unit`."""

    name: str
    unit: str
    sd: float


@dataclass(frozen=True)
class Columns:
    """parameters: q of them.  table: CoM of the segment table [m], (n, 3).  basis: [m] per unit, (n, 3, q).  directions: of the
    segments, (n, s, 3)."""

    parameters: tuple[Parameter, ...]
    table: Array
    basis: Array
    directions: Array

    def prior(self, times: float = 1.0) -> Prior:
        """The table's numbers, spread `times` as far as people are."""
        sd = np.array([p.sd for p in self.parameters]) * times
        return Prior(np.zeros(len(sd)), np.diag(sd**2))


def columns(body: Body, tied: bool = False) -> Columns:
    """What each parameter does to the CoM in each frame of a body.  tied: left and right are alike."""
    axes = _axes(body)
    table, r = body.com(), body.centres()
    mu = body.masses / body.share
    out: list[tuple[Parameter, Array]] = []
    for name, members in _pairs(body.names).items():
        heavier = [mu[s] * (r[:, s] - table) for s in members]
        longer = [mu[s] * axes.long[:, s] for s in members]
        out.append((Parameter(f"{name}.mass", "1", MASS), np.add.reduce(heavier)))
        if len(members) == 1:
            turned = {"forward": axes.front, "lateral": axes.across, "up": -axes.u}
            out += [(Parameter(f"{name}.{k}", "m", TRUNK[k]), mu[members[0]] * v[:, members[0]]) for k, v in turned.items()]
            continue
        out.append((Parameter(f"{name}.along", "1", ALONG), np.add.reduce(longer)))
        if tied:
            out.append((Parameter(f"{name}.forward", "m", ACROSS), np.add.reduce([mu[s] * axes.front[:, s] for s in members])))
            continue
        out.append((Parameter(f"{name}.mass_right-left", "1", SIDES), 0.5 * (heavier[0] - heavier[1])))
        out.append((Parameter(f"{name}.along_right-left", "1", SIDES), 0.5 * (longer[0] - longer[1])))
        for s in members:
            out.append((Parameter(f"{body.names[s]}.forward", "m", ACROSS), mu[s] * axes.front[:, s]))
            out.append((Parameter(f"{body.names[s]}.lateral", "m", ACROSS), mu[s] * axes.across[:, s]))
    right = heading(body)
    ahead = np.cross(UP, right)
    size = np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-9)
    out += [(Parameter(f"whole.{k}", "m", WHOLE[k]), v) for k, v in (("forward", ahead / size), ("lateral", right))]
    return Columns(tuple(p for p, _ in out), table, np.stack([c for _, c in out], axis=2), axes.u)


class _Axes(NamedTuple):
    """Of the segments, each (n, s, 3).  long: [m] proximal to distal, u: its direction, across: to the right, front: forward, of at
    most unit length: 0 for a segment that points sideways, whose front nobody sees."""

    long: Array
    u: Array
    across: Array
    front: Array


def _axes(body: Body) -> _Axes:
    long = body.distal - body.proximal
    u = long / np.maximum(np.linalg.norm(long, axis=2), 1e-9)[..., None]
    right = heading(body)
    across = right[:, None] - np.einsum("nsk,nk->ns", u, right)[..., None] * u
    return _Axes(long, u, across, np.cross(across, u))


def _pairs(names: list[str]) -> dict[str, list[int]]:
    """Segment -> places of its right and left one, or of the one there is."""
    out = dict[str, list[int]]()
    for i, name in enumerate(names):
        base = name.removesuffix("_right").removesuffix("_left")
        twin = {f"{base}_right", f"{base}_left"} <= set(names)
        out.setdefault(base if twin else name, []).append(i)
    return {k: sorted(v, key=lambda i: names[i].endswith("_left")) for k, v in out.items()}


def heading(body: Body) -> Array:
    """Unit vector to the subject's right in each frame (n, 3): from hip to hip, else shoulder to shoulder, else the pipeline's x."""
    for base in ("thigh", "upper_arm", "shank"):
        if {f"{base}_right", f"{base}_left"} <= set(body.names):
            d = body.proximal[:, body.names.index(f"{base}_right")] - body.proximal[:, body.names.index(f"{base}_left")]
            size = np.linalg.norm(d, axis=1, keepdims=True)
            if np.nanmedian(size) > SMALL:
                return np.asarray(d / size)
    return np.tile(LATERAL, (len(body.proximal), 1))


def turned(directions: Array) -> Array:
    """How far poses are from each other: rms angle between the same segments [rad], (k, k).  directions: unit vectors (k, s, 3)."""
    k, s, _ = directions.shape
    flat = directions.reshape(k, 3 * s)
    square = 2.0 * (s - flat @ flat.T) / s  # |u - v|^2 = 2 - 2 u.v, the angle squared for small ones
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))
