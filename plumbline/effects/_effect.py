r"""The contract of an effect: one physical cause, one file, found by itself.

The plant without effects is :math:`\ddot x = \omega^2 (x - p)`; where the shear force is recorded it splits into
:math:`\ddot x = F_x/m` (the kinematic side) and :math:`x - p = (F_x/m)/\omega^2` (the moment side). A plant effect says what it adds
to the right side of each, linear in its coefficients :math:`\theta`:

.. math:: \ddot x = \omega^2 (x - p) + \sum_j \theta_j\, c_j(t), \qquad \ddot x = F_x/m + \sum_j \theta_j\, f_j(t)

`columns` gives the :math:`c_j`, `force` the :math:`f_j` (None: the effect does not touch the kinematic side). Both are functions of
the measured channels, frame by frame; the weak form averages them. An effect that is not linear in its parameters gives the columns at zero
and a function `undo` that takes a given amount of it out of the channels exactly; the search then repeats itself from there.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbline.effects._channels import Channels

Array = NDArray[np.float64]
LEDGERS = ("plant", "control", "robot")


@dataclass(frozen=True)
class Parameter:
    """One number of an effect.

    unit: SI.  lower, upper: what is physically possible.  physics: the value that physics fixes, and `within`: how far from it an estimate
    may lie.  matters: least size worth a name.
    """

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    physics: float | None = None
    within: float = np.inf
    matters: float = 0.0

    def refusal(self, value: float) -> str:
        """Why a value cannot be this parameter, in words; empty where it can."""
        if not self.lower <= value <= self.upper:
            unit = "" if self.unit == "1" else f" {self.unit}"
            return f"{self.name} = {value:.3g}{unit} is not possible (from {self.lower:g} to {self.upper:g})"
        if self.physics is not None and abs(value - self.physics) > self.within:
            return f"{self.name} = {value:.3g}, physics says {self.physics:g}"
        return ""


@dataclass(frozen=True)
class Effect:
    r"""What the paper's equations lack.

    title: in words. ledger: plant, control or robot. equation: LaTeX, what it adds to x'' (plant) or to p (control). source: paper or
    this file. needs: channels. parameters: names as in the verdict. confounded: ids that look the same in some data. separated: the
    recording that tells them apart. columns, force: signals -> (n, k) [m/s2 per unit of the coefficient], see the module; vertical:
    the same for z'' + g = Fz/m. values: (coefficients (k,), constant of the kinematic side [N]) -> parameters, where they are not the
    same. undo: (channels, parameters) -> channels without it. settled: fitted always and taken out before anything else is judged.
    searched: False for what would explain any fault of the markers: it is judged where the user adds it, and never looked for.
    recorded: what is recorded differs from the truth, not what the body does.
    twin: id of an effect, or w2, that no recording of motion can tell it from; it is never searched for, only named beside it. law:
    for control effects, see ``plumbline/control``. id, file: filled in by the catalogue.
    """

    title: str
    ledger: str
    equation: str
    source: str
    needs: tuple[str, ...]
    parameters: tuple[Parameter, ...]
    columns: Callable[[Channels], Array] | None = None
    force: Callable[[Channels], Array] | None = None
    vertical: Callable[[Channels], Array] | None = None
    values: Callable[[Array, float], Array] | None = None
    undo: Callable[[Channels, Array], Channels] | None = None
    confounded: tuple[str, ...] = ()
    separated: str = ""
    settled: bool = False
    recorded: bool = False
    searched: bool = True
    twin: str = ""
    law: Any = None
    id: str = ""
    file: str = ""

    def __post_init__(self) -> None:
        """Raises ValueError for a contract that nobody could keep."""
        if self.ledger not in LEDGERS:
            raise ValueError(f"ledger '{self.ledger}': one of {', '.join(LEDGERS)} is wanted")
        if not self.parameters:
            raise ValueError("an effect needs at least one Parameter")
        if self.ledger == "plant" and self.columns is None:
            raise ValueError("a plant effect needs columns: a function of the channels that gives (n, k) [m/s2]")
        if isinstance(self.needs, str) or isinstance(self.confounded, str):
            raise ValueError("needs and confounded are tuples: write ('com_x',) with the comma")

    @property
    def exact(self) -> bool:
        """Whether a model that has it is judged with its whole size, which physics fixes, taken out of the channels."""
        return self.undo is not None and not self.searched and all(p.physics is not None for p in self.parameters)

    def of_coefficients(self, theta: Array, constant: float = 0.0) -> Array:
        """Parameters from the coefficients of the columns and the constant of the kinematic side [N]."""
        return theta if self.values is None else np.asarray(self.values(theta, constant))
