"""What every reader returns: SI units, the lab's own axes, nothing judged yet."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class RawPlate:
    """One force plate as recorded, lab axes.

    time: [s], shape (k,).  force: [N], shape (k, 3), sign as recorded.  moment: [N m] about `origin`, shape (k, 3).
    origin: reference point of the moment [m], shape (3,) (the centre of the plate's surface where known).
    corners: [m], shape (4, 3), or None where the file has none.  kind: "type-2", "mot", "text", ...
    foot: "left", "right", "none" (a handle, a seat) or "" where the file does not say.
    notes: what was found odd, in words (stuck channels are named "stuck: <channel>").
    """

    time: Array
    force: Array
    moment: Array
    origin: Array
    corners: Array | None
    kind: str
    foot: str = ""
    notes: list[str] = field(default_factory=list)


@dataclass
class Raw:
    """One file, in SI units and the lab's own axes.

    time: of the marker frames [s], shape (n,), may be empty and need not start at 0.  rate: stated or median rate [Hz].
    points: markers [m], shape (n, m, 3), missing as NaN.  labels: the m labels, unique (repeats get a suffix `.2`).
    derived: other point channels in [m], label -> (n, 3): the lab's CentreOfMass, joint centres of a model, ...
    channels: other named signals at the marker rate, name -> (n,) in SI (CoP-only files: "cop_a", ...).
    plates: force plates.  notes: what was assumed or found odd, in words.
    """

    time: Array
    rate: float
    points: Array
    labels: list[str]
    derived: dict[str, Array] = field(default_factory=dict)
    channels: dict[str, Array] = field(default_factory=dict)
    plates: list[RawPlate] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
