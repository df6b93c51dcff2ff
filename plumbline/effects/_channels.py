"""What an effect is given: the channels of one trial along one axis, by the names of the table `signals`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.physics import G

Array = NDArray[np.float64]

AXIS = {"lateral": ("x", "y"), "forward": ("y", "x")}
"""Axis that is judged and the other one, as in the tables."""


@dataclass(frozen=True)
class Person:
    """Where a person is, one for all trials.

    height: of the CoM over the plates, mean of the trials [m], NaN where not known.  middle: axis -> mean of the ZMP of all trials [m].
    """

    height: float
    middle: Mapping[str, float]


def persons(signals: pd.DataFrame, coverage: pd.DataFrame) -> dict[str, Person]:
    """subject -> Person.  signals: all trials of each.  coverage: its rows give the heights, so the same rows must go to every stage."""
    heights = coverage.groupby("subject", observed=True)["height_com"].mean()
    middles = signals.groupby("subject", observed=True)[[f"zmp_{here}" for here, _ in AXIS.values()]].mean()
    return {
        str(subject): Person(float(heights.get(subject, np.nan)), dict(zip(AXIS, map(float, row), strict=True)))
        for subject, *row in middles.itertuples()
    }


@dataclass(frozen=True)
class Channels:
    """One trial, one axis; arrays (n,) at the rate of the frames, NaN where not recorded.

    Along the axis that is judged: com_x, zmp_x, grf_x, ang_mom (about the CoM, positive turning +z towards +x); com_z, hand_z (above
    the plates), grf_z, time (from the trial's start), and every other column of `signals` by its own name, x for the axis and y for the
    other. `_dot` and `_ddot` behind any name are time derivatives (central differences: the weak form averages them). w2: of the base
    model [1/s2]; mass [kg]; rate [Hz]; height: of the person's CoM [m]; middle: where the person stands along the axis [m]; g.
    """

    values: Mapping[str, Array]
    rate: float
    mass: float
    height: float
    w2: float = 0.0
    middle: float = 0.0
    g: float = G

    def __getitem__(self, name: str) -> Array:
        """A channel [SI], shape (n,).  Raises KeyError for a name that no table has."""
        if name in self.values:
            return self.values[name]
        for ending, order in (("_ddot", 2), ("_dot", 1)):
            if name.endswith(ending) and name.removesuffix(ending) in self.values:
                return derivative(self.values[name.removesuffix(ending)], self.rate, order)
        raise KeyError(f"no channel '{name}'; there are {', '.join(sorted(self.values))}, each also with _dot and _ddot")

    def __getattr__(self, name: str) -> Array:
        """`c.com_x_dot` is `c["com_x_dot"]`."""
        if name.startswith("_") or name == "values":
            raise AttributeError(name)
        try:
            return self[name]
        except KeyError as error:
            raise AttributeError(error.args[0]) from None

    def has(self, name: str) -> bool:
        """Whether a channel was recorded (any finite value)."""
        try:
            return bool(np.isfinite(self[name]).any())
        except KeyError:
            return False

    def changed(self, **channels: Array) -> Channels:
        """The same with other values."""
        return replace(self, values={**self.values, **channels})

    def shifted(self, names: tuple[str, ...], delay: float) -> Channels:
        """The same with the named channels that were recorded `delay` [s] late put back (linear between frames), NaN at the ends."""
        n = len(self.values["time"])
        at = np.arange(n) + delay * self.rate
        return self.changed(**{k: np.interp(at, np.arange(n), self.values[k], np.nan, np.nan) for k in names if self.has(k)})


def of_trial(frames: pd.DataFrame, axis: str, mass: float, person: Person) -> Channels:
    """Channels of one trial.  frames: its rows of `signals`.  axis: lateral or forward.  mass [kg].

    person: whose trial it is; a height that is not known is that of this trial.
    """
    here, other = AXIS[axis]
    swap = {f"_{here}": "_x", f"_{other}": "_y"}
    out: dict[str, Array] = {}
    for name in frames.columns:
        if frames[name].dtype.kind == "f":
            out[name[:-2] + swap[name[-2:]] if name[-2:] in swap else name] = frames[name].to_numpy()
    # about +y a rotation turns +z towards +x; about +x it turns +y towards +z, so the forward axis counts it the other way round
    out["ang_mom"] = out["ang_mom_y"] if axis == "lateral" else -out["ang_mom_y"]
    for name in {"com_z", "hand_z"} & out.keys():
        out[name] = out[name] - np.nan_to_num(out["zmp_z"])
    out["time"] = out["time"] - out["time"][:1]
    rate = (len(frames) - 1) / float(np.ptp(out["time"])) if len(frames) > 1 else float("nan")
    own = float(np.nanmean(out["com_z"])) if np.isfinite(out["com_z"]).any() else float("nan")
    return Channels(out, rate, mass, person.height if np.isfinite(person.height) else own, middle=person.middle[axis])


def derivative(values: Array, rate: float, order: int) -> Array:
    """Central differences of a channel over its runs without NaN, one-sided at their ends.  values: (n,).  order: 1 or 2."""
    out = np.asarray(values, float)
    known = np.isfinite(out)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], known.view(np.int8), [0]])))
    made = np.full(len(out), np.nan)
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if b - a > 2:
            piece = out[a:b]
            for _ in range(order):
                piece = np.gradient(piece, 1.0 / rate)
            made[a:b] = piece
    return made
