"""Rows of the table `control`."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbline.control_scene import Stage
from plumbline.effects import Effect, Parameter
from plumbline.estimators.clustered import jackknife, reach
from plumbline.estimators.loop_error import Fit
from plumbline.tables import TABLES

Array = NDArray[np.float64]

DOUBT = 1.0  # share of a time taken out of the instruments below which a time of the law is not believed


def of_fit(got: Fit, sums: tuple[Array, ...], stage: Stage, known: Mapping[str, Effect]) -> Iterator[dict[str, Any]]:
    """One row per trial of a candidate; sums: of each locus, the first four of the table's."""
    trials = np.asarray(stage.trials)
    frames = stage.scene.batch.inside.sum(0)
    found = _parameters(got, known)
    least = {"s": DOUBT * stage.shift}  # a filter is not quite the delay that was taken out
    refused = any(_faint(found[n], known[n].parameters, least) for n in found)
    refused |= any(found[n][p.name]["value"] in (p.lower, p.upper) for n in found for p in known[n].parameters if p.matters)
    about = {"candidate": "+".join(got.candidate.effects), "parameters": json.dumps(found), "refused": refused, "settled": got.settled}
    about |= {"mode": "loop" if got.candidate.closed else "frame"}
    about |= {"d": float(got.theta[0]), "k1": float(got.theta[1]), "k2": float(got.theta[2]), "sizes": len(got.theta) - 3}
    names = ("square_sum", "zmp_square_sum", "score", "fitted_square_sum")
    for trial in np.unique(trials):
        mine = trials == trial
        row = {"trial": str(trial), "loci": int(mine.sum()), "frames": int(frames[mine].sum())}
        yield blank() | about | row | {name: float(one[mine].sum()) for name, one in zip(names, sums, strict=True)}


def _faint(found: Mapping[str, Any], parameters: Sequence[Parameter], least: Mapping[str, float]) -> bool:
    """Whether every parameter that has a least size is below it; least: by unit, beside the parameters' own."""
    sizes = {p.name: size for p in parameters if (size := max(p.matters, least.get(p.unit, 0.0))) > 0}
    return bool(sizes) and all(abs(found[name]["value"]) < size for name, size in sizes.items())


def _parameters(got: Fit, known: Mapping[str, Effect]) -> dict[str, dict[str, Any]]:
    """effect -> parameter -> value, unit, 95 % interval; clustered by locus."""
    free = np.diag(got.normals.sum(0)) > 0
    covariance = np.full((len(got.theta),) * 2, np.nan)
    covariance[np.ix_(free, free)] = jackknife(got.normals[:, free][:, :, free], got.scores[:, free])
    out: dict[str, dict[str, Any]] = {}
    at = 3
    for name in got.candidate.effects:
        out[name] = {}
        for p in known[name].parameters:
            value, half = float(got.theta[at]), float(reach(covariance[at, at], len(got.cost)))
            ends = [max(value - half, p.lower), min(value + half, p.upper)] if np.isfinite(half) else None
            out[name][p.name] = {"value": value, "unit": p.unit, "ci95": ends}
            at += 1
    return out


def blank() -> dict[str, Any]:
    """A row with nothing in it."""
    return {c.name: {"str": "", "int": 0, "float": float("nan"), "bool": False}[c.kind] for c in TABLES["control"]}
