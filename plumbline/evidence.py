r"""Weak terms of every effect: what each would add to the plant equation, window by window.

Three equations are looked at, each averaged with the bump of the fit:

- kinematic: :math:`\ddot x - F_x/m` (whatever p, z and L do);
- moment: :math:`(x - p) - h\,F_x/m`, with the measured force in place of :math:`\ddot x`: markers differentiated twice would
  stand on both sides and explain their own noise;
- vertical: :math:`\ddot z + g - F_z/m`.

Without shear there is only the whole equation, :math:`(x - p) - h\,\ddot x`. Everything is linear in the coefficients, so these
windows are all that the search needs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.effects import Catalogue, Channels, Effect
from plumbline.effects._channels import of_trial
from plumbline.plant import Plant, of_trials
from plumbline.shapes import SHAPES
from plumbline.weak import Bump, white_noise_sd

Array = NDArray[np.float64]
PARTS = ("force", "plain", "by_w2", "vertical")
"""Parts of an effect's columns: kinematic side; moment side without and with the factor w2; vertical side."""


@dataclass(frozen=True)
class Weak:
    """Windows of one trial and axis, n of them; every array (n,) unless said.

    com, velocity, zmp: bump means.  acceleration: weak x'' [m/s2].  force: Fx/m [m/s2], NaN without shear.  vertical: z'' + g - Fz/m.
    lever: x - p [m].  cluster: number of the independent piece.  terms: effect -> part -> (n, k).  lacking: effect -> what it needs.
    noise: sd of the white noise of x, p [m], z [m], Fx, Fz [N]; NaN where not known.  unit: sums of squares of the bump and its curvature.
    """

    trial: str
    subject: str
    task: str
    condition: str
    axis: str
    frame: NDArray[np.int64]
    time: Array
    cluster: NDArray[np.int64]
    com: Array
    velocity: Array
    zmp: Array
    acceleration: Array
    force: Array
    vertical: Array
    mass: float
    height: float
    noise: dict[str, float]
    bump: Bump
    terms: dict[str, dict[str, Array]]
    lacking: dict[str, str]
    names: frozenset[str] = frozenset()

    @property
    def lever(self) -> Array:
        """Bump mean of x - p [m]."""
        return self.com - self.zmp

    def floor(self, equation: str, h: float) -> float:
        """Variance that white sensor noise alone gives in an equation (whole, moment, kinematic, vertical); NaN where not known."""
        f, f2 = self.bump.value, self.bump.curvature
        n, m = self.noise, self.mass
        if equation == "whole":
            return float(n["x"] ** 2 * np.sum((f - h * f2) ** 2) + n["p"] ** 2 * (f @ f))
        if equation == "moment":
            return float((n["x"] ** 2 + n["p"] ** 2 + (h * n["fx"] / m) ** 2) * (f @ f))
        place, load = ("x", "fx") if equation == "kinematic" else ("z", "fz")
        return float(n[place] ** 2 * (f2 @ f2) + (n[load] / m) ** 2 * (f @ f))


def of_part(
    signals: pd.DataFrame, pushes: pd.DataFrame, coverage: pd.DataFrame, effects: Catalogue, evaluation: Mapping[str, Any],
    undo: Mapping[str, Mapping[str, Array]] | None = None,
) -> Iterator[Weak]:  # fmt: skip
    """Windows of every trial and axis that has a CoM and a ZMP.

    undo: "subject/axis" -> effect -> parameters that are taken out of the channels first (effects with `undo`).
    """
    chosen = {k: e for k, e in effects.items() if e.ledger == "plant" and e.columns is not None and not e.twin}
    settings = {k: evaluation[k] for k in ("half_width", "exponent")}
    for about, frames, plants in of_trials(signals, pushes, coverage, **settings):
        for axis, plant in plants.items():
            channels = of_trial(frames, axis, float(about["mass"]))
            out = (undo or {}).get(f"{about['subject']}/{axis}", {})
            for name, values in out.items():
                channels = effects[name].undo(channels, values)  # type: ignore[misc]
            yield of_one(about, channels, axis, plant, chosen | SHAPES)


def of_one(about: Any, channels: Channels, axis: str, plant: Plant, effects: Mapping[str, Effect]) -> Weak:
    """Windows of one trial and axis from its channels."""
    picked, bump = plant.picked, plant.bump

    def mean(values: Array, weights: Array = bump.value) -> Array:
        """Bump-weighted mean of (n,) or (n, k) at the picked frames."""
        columns = values.reshape(len(values), -1)
        seen = np.lib.stride_tricks.sliding_window_view(columns, len(weights), axis=0)[picked - bump.reach]
        return np.asarray(seen @ weights).reshape(len(picked), *values.shape[1:])

    terms: dict[str, dict[str, Array]] = {}
    lacking: dict[str, str] = {}
    for name, effect in effects.items():
        missing = [need for need in effect.needs if not channels.has(need)]
        if missing:
            lacking[name] = ", ".join(missing)
            continue
        parts = _parts(effect, channels)
        weak = {part: mean(values) for part, values in parts.items()}
        if all(np.isfinite(v).all() for v in weak.values()):
            terms[name] = weak
        else:
            lacking[name] = f"{', '.join(effect.needs)} without gaps"
    x, z = channels.com_x, channels.com_z
    noise = {"x": plant.noise_x, "p": plant.noise_p, "z": _noise(z, plant)}
    noise |= {"fx": _noise(channels.grf_x, plant), "fz": _noise(channels.grf_z, plant)}
    vertical = mean(z, bump.curvature) + channels.g - mean(channels.grf_z) / channels.mass
    key = (about["trial"], about["subject"], about["task"], about["condition"], axis)
    motion = (mean(x), mean(x, bump.slope), mean(channels.zmp_x), mean(x, bump.curvature))
    return Weak(
        *key, picked, channels.time[picked], plant.cluster[picked], *motion,
        mean(channels.grf_x) / channels.mass, vertical, channels.mass, plant.height, noise, bump, terms, lacking,
    )  # fmt: skip


def _noise(values: Array, plant: Plant) -> float:
    return float(white_noise_sd(values)) if np.isfinite(plant.noise_x) and np.isfinite(values).any() else float("nan")


def _parts(effect: Effect, c: Channels) -> dict[str, Array]:
    """Columns of an effect frame by frame, the moment side split as plain + w2 by_w2."""
    assert effect.columns is not None
    plain = effect.columns(_with(c, 0.0))
    parts = {"plain": plain, "by_w2": effect.columns(_with(c, 1.0)) - plain}
    nothing = np.zeros_like(plain)
    parts["force"] = effect.force(c) if effect.force is not None and c.has("grf_x") else nothing
    parts["vertical"] = effect.vertical(c) if effect.vertical is not None and c.has("grf_z") else nothing
    return parts


def _with(c: Channels, w2: float) -> Channels:
    return Channels(c.values, c.rate, c.mass, w2, c.g)
