"""The plant of a study judged: windows with the instruments settled, subject by subject, then all subjects together."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import evidence
from plumbline.effects import Catalogue, Effect
from plumbline.evidence import Weak
from plumbline.physics import G
from plumbline.ranking import LEANS, Finding, judge

Array = NDArray[np.float64]

ROUNDS = 3  # times that what is settled is taken out of the channels and found again
NEAR = 0.02  # [1] to which the lever per acceleration is found
BODIES = (0.8, 1.5)  # [1] lever per acceleration in parts of z/g: rigid bodies and people who counter-rotate
WORTH = 0.3  # [1] of the size that matters, from which on a settled effect is taken out


def settled(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, evaluation: Mapping[str, Any]
) -> Iterator[tuple[list[Weak], Finding]]:
    """Windows of each subject and axis, what is always fitted taken out of the channels exactly; and what that subject's data say.

    A delay is known only to first order at a time; taken out and found again, the rest is small.
    """
    plant = {k: e for k, e in effects.items() if e.ledger == "plant"}
    for subject in sorted(coverage["subject"].unique()):
        mine = coverage[coverage["subject"] == subject]
        for axis in ("lateral", "forward"):
            yield from _settled(signals, pushes, mine, effects, plant, evaluation, axis)


def _settled(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, plant: Mapping[str, Effect],
    evaluation: Mapping[str, Any], axis: str,
) -> Iterator[tuple[list[Weak], Finding]]:  # fmt: skip
    out: dict[str, Array] = {}
    h = 0.0
    for _ in range(ROUNDS):
        windows = list(evidence.of_part(signals, pushes, coverage, effects, evaluation, undo=out, axis=axis))
        if len(windows) < 2:
            return
        finding = judge([windows], plant, [gravity(windows)], [h] if h else ())
        before, out = out, _taken(finding, plant)
        last, h = h or LEANS / gravity(windows), lever(finding, windows)
        if not _moved(before, out, plant) and abs(h / last - 1) < NEAR:
            break
    yield windows, finding


def together(each: Sequence[Sequence[Weak]], h: Sequence[float], plant: Mapping[str, Effect]) -> Finding:
    """What several subjects say on one axis.  each: windows of each, settled.  h: lever per acceleration of each [s2]."""
    return judge(each, plant, [gravity(windows) for windows in each], h)


def lever(finding: Finding, windows: Sequence[Weak]) -> float:
    """Lever per acceleration that a subject's data give, within what a body can be [s2]."""
    return float(np.clip(finding.theta[0]["=h"][0] * gravity(windows), *BODIES)) / gravity(windows)


def gravity(windows: Sequence[Weak]) -> float:
    """g/z of a subject [1/s2]."""
    return G / float(np.mean([w.height for w in windows]))


def _taken(finding: Finding, plant: Mapping[str, Effect]) -> dict[str, Array]:
    """Coefficients that are worth taking out, of a finding about one subject."""
    out = {}
    for name, theta in finding.theta[0].items():
        effect = plant.get(name)
        if effect is not None and effect.settled and effect.undo and abs(theta[0]) > WORTH * effect.parameters[0].matters:
            out[name] = theta
    return out


def _moved(before: Mapping[str, Array], after: Mapping[str, Array], plant: Mapping[str, Effect]) -> bool:
    """Whether what is taken out differs from what was."""
    least = {k: WORTH * plant[k].parameters[0].matters for k in {*before, *after}}
    return any(np.max(np.abs(after.get(k, np.zeros(1)) - before.get(k, np.zeros(1)))) > size for k, size in least.items())
