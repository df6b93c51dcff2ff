r"""Weak terms of every effect: what each would add to the plant equation, window by window.

Three equations are looked at, each averaged with the bump of the fit:

- kinematic: :math:`\ddot x - F_x/m` (whatever p, z and L do);
- moment: :math:`(x - p) - h\,F_x/m`, with the measured force in place of :math:`\ddot x`: markers differentiated twice would
  stand on both sides and explain their own noise;
- vertical: :math:`\ddot z + g - F_z/m`.

Without shear there is only the whole equation, :math:`(x - p) - h\,\ddot x`. Everything is linear in the coefficients, so these
windows are all that the search needs.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.effects import Catalogue, Channels, Effect, where
from plumbline.effects._channels import of_trial, persons
from plumbline.fit import BOTH, use
from plumbline.plant import AXES, Plant, of_trials
from plumbline.shapes import SHAPES
from plumbline.study import names
from plumbline.tables import joined
from plumbline.weak import Bump, white_noise_sd

Array = NDArray[np.float64]
PARTS = ("force", "plain", "by_w2", "vertical")
"""Parts of an effect's columns: kinematic side; moment side without and with the factor w2; vertical side."""


@dataclass(frozen=True)
class Weak:
    """Windows of one trial and axis, n of them; every array (n,) unless said.

    com, velocity, zmp: bump means.  acceleration: weak x'' [m/s2].  force: Fx/m [m/s2], NaN without shear.  vertical: z'' + g - Fz/m.
    lever: x - p [m].  cluster: number of the independent piece.  terms: effect -> part -> (n, k).  lacking: effect -> what it needs.
    centre: effect -> coefficients that were taken out of the channels first.  use: of the trial.  w2: (z'' + g)/z of
    each window [1/s2]; None where read from a table.
    feet: CoP of both plates from the middles of their feet,
    mean over the trial [m]; NaN where the feet are not known from markers, and for the forward axis.
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
    centre: Mapping[str, Array] = field(default_factory=dict)
    feet: float = float("nan")
    use: str = BOTH
    w2: Array | None = None

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
    *, undo: Mapping[str, Array] | None = None, read: Mapping[str, str] | None = None, axis: str = "",
) -> Iterator[Weak]:  # fmt: skip
    """Windows of every trial and axis that has a CoM and a ZMP.

    coverage: its rows choose the trials; with the column `files` where the config may call them by their files.
    undo: effect -> coefficients that are taken out of the channels first (effects with `undo`).
    read: effect -> the one as which it is taken out, where no motion tells the two apart to first order.
    axis: lateral or forward; both where empty.
    """
    chosen = {k: e for k, e in effects.items() if e.ledger == "plant" and e.columns is not None and not e.twin}
    settings: dict[str, Any] = {k: evaluation[k] for k in ("half_width", "exponent")}
    settings["axes"] = (axis,) if axis else tuple(AXES)
    who = persons(signals, coverage)
    for about, frames, plants in of_trials(signals, pushes, coverage, **settings):
        for here, plant in plants.items():
            channels = of_trial(frames, here, float(about["mass"]), who[about["subject"]])
            follows = about["com_method"] == "force"
            if follows:  # the CoM was made from the shear: it has nothing to say against it
                channels = channels.changed(grf_x=np.full(len(channels.time), np.nan), grf_y=np.full(len(channels.time), np.nan))
            noise = _noise(channels, plant)  # of what was recorded: between frames some of it is averaged away
            for name, theta in (undo or {}).items():
                channels = effects[(read or {}).get(name, name)].undo(channels, theta)  # type: ignore[misc]
            made = of_one(about, channels, here, plant, chosen | SHAPES)
            feet = _feet(channels) if here == "lateral" and about["support"] == "markers" else float("nan")
            used = use(names(about["trial"], about["task"], str(about.get("files", "")).split(" + ")), evaluation)
            yield replace(_without_markers(made) if follows else made, noise=noise, centre=dict(undo or {}), feet=feet, use=used)


def split(values: Array, windows: Sequence[Weak]) -> list[Array]:
    """Values of all windows (N, ...), trial by trial."""
    return np.split(values, np.cumsum([len(w.time) for w in windows])[:-1])


MARKERS = ("sync", "com_bias", "soft_tissue", "offset", "tilt", "gain", "force_scale", "shear")
"""Effects that set the force record against the markers."""


def _without_markers(w: Weak) -> Weak:
    """Windows whose CoM follows the force by assumption: no delay, scale or constant between the two can be told."""
    terms = {k: v for k, v in w.terms.items() if k not in MARKERS}
    return replace(w, terms=terms, lacking=w.lacking | dict.fromkeys((k for k in MARKERS if k in w.terms), "a CoM from markers"))


def _feet(c: Channels) -> float:
    """How far the CoP of each plate lies to the right of the middle of its foot, both feet together [m]."""
    if not (c.has("cop_left_x") and c.has("cop_right_x")):
        return float("nan")
    return float(np.nanmean(c.cop_left_x - c.limit_left) + np.nanmean(c.cop_right_x - c.limit_right)) / 2


def of_one(about: Any, channels: Channels, axis: str, plant: Plant, effects: Mapping[str, Effect]) -> Weak:
    """Windows of one trial and axis from its channels."""
    bump = plant.bump
    picked = plant.picked
    # channels put back in time have no ends; without them there is no window
    seen = [channels[k] for k in ("zmp_x", "grf_x") if channels.has(k)]
    picked = picked[np.all([np.isfinite(_mean(c, bump.value, picked)) for c in seen], axis=0)]
    picked = picked[picked + bump.reach < _fallen(channels, axis)]

    def mean(values: Array, weights: Array = bump.value) -> Array:
        return _mean(values, weights, picked)

    terms: dict[str, dict[str, Array]] = {}
    lacking: dict[str, str] = {}
    for name, effect in effects.items():
        missing = [need for need in effect.needs if not channels.has(need)]
        if missing:
            lacking[name] = ", ".join(missing)
            continue
        try:
            parts = _parts(effect, channels)
        except Exception as error:  # a user's file may fail in any way; the others go on
            lacking[name] = f"its file to be put right: {where(error, Path(effect.file))}"
            continue
        weak = {part: mean(values) for part, values in parts.items()}
        if all(np.isfinite(v).all() for v in weak.values()):
            terms[name] = weak
        else:
            gaps = [need for need in effect.needs if not np.isfinite(channels[need]).all()]
            lacking[name] = f"{', '.join(gaps)} without gaps" if gaps else "columns without NaN"
    x, z = channels.com_x, channels.com_z
    vertical = mean(z, bump.curvature) + channels.g - mean(channels.grf_z) / channels.mass
    w2 = (mean(z, bump.curvature) + channels.g) / mean(z)
    key = (about["trial"], about["subject"], about["task"], about["condition"], axis)
    motion = (mean(x), mean(x, bump.slope), mean(channels.zmp_x), mean(x, bump.curvature))
    return Weak(
        *key, picked, channels.time[picked], plant.cluster[picked], *motion,
        mean(channels.grf_x) / channels.mass, vertical, channels.mass, plant.height, _noise(channels, plant), bump, terms, lacking, w2=w2,
    )  # fmt: skip


def _fallen(c: Channels, axis: str) -> int:
    """Frame from which on the CoM is beside the feet for good; the number of frames where it is not.

    One fall reaches ten times as far as all that the person recovered from: left out, it would be told from the others by a line.
    """
    n = len(c.com_x)
    if axis != "lateral" or not c.has("limit_left"):
        return n + 1
    # a person never comes back from there; walkers do, at their next step
    beside = (c.com_x < np.nanmin(c.limit_left)) | (c.com_x > np.nanmax(c.limit_right))
    back = np.flatnonzero(~beside & np.isfinite(c.com_x))
    return int(back[-1]) + 1 if len(back) and beside[back[-1] :].any() else n + 1


def _mean(values: Array, weights: Array, picked: NDArray[np.int64]) -> Array:
    """Weighted mean of (n,) or (n, k) at the picked frames."""
    columns = values.reshape(len(values), -1)
    seen = np.lib.stride_tricks.sliding_window_view(columns, len(weights), axis=0)[picked - len(weights) // 2]
    return np.asarray(seen @ weights).reshape(len(picked), *values.shape[1:])


def _noise(c: Channels, plant: Plant) -> dict[str, float]:
    """Sd of the white noise of x, p, z, Fx, Fz."""
    others = {"z": c.com_z, "fx": c.grf_x, "fz": c.grf_z}
    known = np.isfinite(plant.noise_x)
    sd = {k: float(white_noise_sd(v)) if known and np.isfinite(v).any() else float("nan") for k, v in others.items()}
    return {"x": plant.noise_x, "p": plant.noise_p, **sd}


def _parts(effect: Effect, c: Channels) -> dict[str, Array]:
    """Columns of an effect frame by frame, the moment side split as plain + w2 by_w2."""
    assert effect.columns is not None
    plain = effect.columns(_with(c, 0.0))
    parts = {"plain": plain, "by_w2": effect.columns(_with(c, 1.0)) - plain}
    nothing = np.zeros(np.shape(plain))
    parts["force"] = effect.force(c) if effect.force is not None and c.has("grf_x") else nothing
    parts["vertical"] = effect.vertical(c) if effect.vertical is not None and c.has("grf_z") else nothing
    number = np.shape(plain)[1] if np.ndim(plain) == 2 else 0
    if effect.values is None and number > len(effect.parameters):
        raise ValueError(f"columns gives {number} columns, the effect has {len(effect.parameters)} Parameter: one each, or say `values`")
    for part, values in parts.items():
        if np.ndim(values) != 2 or len(values) != len(c.time) or np.shape(values)[1] != np.shape(plain)[1]:
            want = f"{len(c.time)} rows and as many columns as `columns` has"
            name = "columns" if part in ("plain", "by_w2") else part
            raise ValueError(f"{name} has the shape {np.shape(values)}; wanted are {want}: write (...)[:, None] or np.column_stack")
    return parts


def _with(c: Channels, w2: float) -> Channels:
    return replace(c, w2=w2)


# -- table ------------------------------------------------------------------------------------------------------------


def to_table(windows: Iterable[Weak]) -> pd.DataFrame:
    """Table `evidence`: one row per window; columns of zeros are left out."""
    return joined("evidence", [_rows(w) for w in windows])


def _rows(w: Weak) -> pd.DataFrame:
    b = w.bump
    out: dict[str, Any] = {
        "trial": w.trial, "subject": w.subject, "task": w.task, "condition": w.condition, "axis": w.axis, "frame": w.frame, "time": w.time,
        "cluster": w.cluster, "com": w.com, "velocity": w.velocity, "zmp": w.zmp, "acceleration": w.acceleration, "force": w.force,
        "vertical": w.vertical, "mass": w.mass, "height": w.height, "rate": b.rate, "half_width": b.half_width, "exponent": b.exponent,
        **{f"noise_{k}": v for k, v in w.noise.items()}, "feet": w.feet, "use": w.use,
        "centre": json.dumps({k: v.tolist() for k, v in w.centre.items()}), "lacking": json.dumps(w.lacking),
    }  # fmt: skip
    for name, parts in w.terms.items():
        for part, values in parts.items():
            out |= {f"{name}.{k}:{part}": column for k, column in enumerate(values.T) if part == "plain" or column.any()}
    return pd.DataFrame(out)


def from_table(table: pd.DataFrame) -> Iterator[Weak]:
    """Windows of each trial and axis of the table `evidence`."""
    parts = [c for c in table.columns if ":" in c]
    values, at = np.nan_to_num(table[parts].to_numpy(float)), {c: k for k, c in enumerate(parts)}
    sizes: dict[str, int] = {}
    for column in parts:
        if column.endswith(":plain"):
            name, k = column.removesuffix(":plain").rsplit(".", 1)
            sizes[name] = max(sizes.get(name, 0), int(k) + 1)
    for key, rows in table.reset_index(drop=True).groupby(["subject", "axis", "trial"], sort=True, observed=True):
        yield _weak(str(key[2]), rows, sizes, values[rows.index], at)


def _weak(trial: str, rows: pd.DataFrame, sizes: Mapping[str, int], values: Array, at: Mapping[str, int]) -> Weak:
    """Windows of one trial.  values: (n, k), columns of the effects' parts.  at: where each of them is."""
    first, lacking = rows.iloc[0], json.loads(rows["lacking"].iloc[0])
    nothing = np.zeros(len(rows))

    def column(name: str, k: int, part: str) -> Array:
        here = at.get(f"{name}.{k}:{part}")
        return nothing if here is None else values[:, here]

    terms = {
        name: {part: np.column_stack([column(name, k, part) for k in range(size)]) for part in PARTS}
        for name, size in sizes.items() if name not in lacking
    }  # fmt: skip
    texts = {k: str(first[k]) for k in ("subject", "task", "condition", "axis", "use")}
    arrays = {k: rows[k].to_numpy() for k in ("frame", "time", "cluster", "com", "velocity", "zmp", "acceleration", "force", "vertical")}
    numbers = {k: float(first[k]) for k in ("mass", "height", "feet")}
    made: dict[str, Any] = {"trial": trial, **texts, **arrays, **numbers, "terms": terms, "lacking": lacking}
    return Weak(
        **made,
        noise={k: float(first[f"noise_{k}"]) for k in ("x", "p", "z", "fx", "fz")},
        bump=Bump(float(first["half_width"]), int(first["exponent"]), float(first["rate"])),
        centre={k: np.array(v) for k, v in json.loads(first["centre"]).items()},
    )
