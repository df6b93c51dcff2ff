"""What a search found: effects with their sizes, what became of every candidate, and what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from plumbline.contest import Refused

Array = NDArray[np.float64]
Set = tuple[str, ...]
Interval = tuple[float, float, float]
Spans = Mapping[str, Sequence[tuple[int, int]]]


@dataclass(frozen=True)
class Found:
    """One effect that the data want.

    effect: id, or empty where only the family can be told.  parameters: name -> value and 95 % interval.
    before, after: held-out error without and with it [m].  p: of no such effect.  q: the same, false discovery rate over the catalogue.
    """

    effect: str
    family: tuple[str, ...]
    parameters: Mapping[str, Interval]
    before: float
    after: float
    p: float
    q: float


@dataclass(frozen=True)
class Candidate:
    """What became of an effect of the catalogue.

    status: found, settled (fitted always, not needed enough for a name), idle (brings nothing), refused, absorbed, alike (of a family
    that is named) or lacking.  error: held-out error with it beside the final model [m].
    low, high: 95 % interval of the fall that it brings [m].
    p: of no such effect.  q: the same, false discovery rate over the catalogue.  vif: variance inflation beside the final model.
    trials: that would find such an effect with 80 % power.  reason: in words.  parameters: as in `Found`, of what is settled.
    """

    effect: str
    status: str
    error: float = float("nan")
    low: float = float("nan")
    high: float = float("nan")
    p: float = float("nan")
    q: float = float("nan")
    vif: float = float("nan")
    trials: float = float("nan")
    reason: str = ""
    parameters: Mapping[str, Interval] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """What the data of one subject (or of several, pooled) say on one axis.

    found: effects.  shapes: shapes without a cause that the residual needs.  refused: impostors.  candidates: every effect.
    lacking: effect -> channels that are missing.  base, final: held-out error of the paper's equation and of the last model [m].
    floor: what sensor noise gives [m], NaN where not known.  over: equation -> residual over noise floor and usual faults.
    left: the equations in which more is left than noise and a model's usual faults explain; empty where the floor is not known.
    theta: of each subject, effect or base column -> coefficients of the last model.
    acts: of each subject, trial -> first and last frame of each time that a contact beside the plates acts.
    """

    found: Sequence[Found] = ()
    shapes: Set = ()
    refused: Sequence[Refused] = ()
    candidates: Sequence[Candidate] = ()
    lacking: Mapping[str, str] = field(default_factory=dict)
    base: float = float("nan")
    final: float = float("nan")
    floor: float = float("nan")
    over: Mapping[str, float] = field(default_factory=dict)
    left: tuple[str, ...] = ()
    theta: Sequence[Mapping[str, Array]] = ()
    acts: Sequence[Spans] = ()
