"""Candidate terms of what a residual may look like: bump means of functions of the channels, nothing differentiated twice."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline.effects import Channels, Effect
from plumbline.effects._channels import of_trial, persons
from plumbline.evidence import Weak
from plumbline.plant import rows_of
from plumbline.weak import Bump

Array = NDArray[np.float64]
Functions = dict[tuple[str, str], Array]

SMOOTH = 0.1  # [s] half width of the bump that x and v are smoothed with before a nonlinear function is taken of them
NOISY = 0.2  # [1] share of a second derivative that may be noise of the markers
COST = {"edge": 1.5, "place": 3.0, "memory": 1.5, "rhythm": 1.5}
"""What a term of a family counts: those whose place or time was looked for count more; the others one."""
DRIVES = ("x", "x^2", "x^3", "|x| x", "v", "v^2", "v^3", "|v| v", "x v", "t", "rubbing", "place", "rhythm", "com_z", "com_y", "com_y_dot")
"""Families that an outer force, or a picture that is warped, can follow: p and L answer to a force, they do not make it."""


@dataclass(frozen=True)
class Library:
    """Candidate terms of some trials.

    names: as they stand in a formula, x, p, z in m and v in m/s.  families: only the best of each competes.  values: of each trial, (n, K).
    """

    names: tuple[str, ...]
    families: tuple[str, ...]
    values: tuple[Array, ...]


def channels(
    windows: Sequence[Weak], signals: pd.DataFrame, coverage: pd.DataFrame, effects: Mapping[str, Effect]
) -> Iterator[tuple[Channels, Weak]]:
    """The channels that windows were made from, what was taken out of them taken out again; trial by trial."""
    rows = signals.groupby("trial", observed=True).indices
    who = persons(signals, coverage)
    for w in windows:
        c = of_trial(rows_of(signals, rows[w.trial]), w.axis, w.mass, who[w.subject])
        for name, theta in w.centre.items():
            c = effects[name].undo(c, theta)  # type: ignore[misc]
        yield c, w


def library(trials: Iterable[tuple[Channels, Weak]]) -> Library:
    """Candidate terms of one axis, of one subject or of several who stood in the same place.

    trials: the channels of each with its windows.
    """
    states = [(c, w, _state(c, w.bump.rate)) for c, w in trials]
    middle = {k: _middle(np.concatenate([s[k] for *_, s in states])) for k in ("x", "p")}
    reach = {
        k: float(np.nanquantile(np.abs(np.concatenate([s[k] for *_, s in states]) - middle.get(k, 0.0)), 0.97)) for k in ("x", "v", "p")
    }
    made = [_terms(c, w, s, middle, reach) for c, w, s in states]
    names = [k for k in made[0] if all(k in m for m in made)]
    return Library(tuple(n for _, n in names), tuple(f for f, _ in names), tuple(np.column_stack([m[k] for k in names]) for m in made))


def _state(c: Channels, rate: float) -> dict[str, Array]:
    """x and v smoothed, p as it is, (n,)."""
    bump = Bump(max(SMOOTH, 4.5 / rate), 4, rate)
    x, v = bump.mean(c.com_x), bump.derivative(c.com_x)
    return {"x": np.where(np.isfinite(x), x, c.com_x), "v": np.where(np.isfinite(v), v, c.com_x_dot), "p": c.zmp_x}


def _middle(f: Array) -> float:
    """Where a channel is counted from: the origin where it was about there, else its median."""
    median = float(np.nanmedian(f))
    return median if abs(median) > 0.2 * float(np.nanquantile(np.abs(f - median), 0.97)) else 0.0


def _terms(c: Channels, w: Weak, state: dict[str, Array], middle: dict[str, float], reach: dict[str, float]) -> Functions:
    """(family, name) -> weak values at the picked frames; those that a gap touches are left out."""
    bump, picked = w.bump, w.frame
    frames = _functions(c, state, middle, reach, bump.rate)
    out = {key: bump.mean(f)[picked] for key, f in frames.items()}
    x = state["x"] - middle["x"]
    for power in (2, 3):  # a picture that is warped shows in x'' as the second derivative of the warp
        warp = bump.second(x**power)[picked]
        noise = w.noise["x"] * np.sqrt(np.mean((power * x ** (power - 1)) ** 2) * (bump.curvature @ bump.curvature))
        if not noise > NOISY * warp.std():  # it shares its noise with x''
            out[f"warp{power}", f"(d/dt)^2 {_shifted('x', middle)}^{power}"] = warp
    return {key: f for key, f in out.items() if np.isfinite(f).all()}


def _shifted(name: str, middle: dict[str, float]) -> str:
    """A variable counted from the middle of where it was, as it is written."""
    shift = round(middle.get(name, 0.0), 3)
    return f"({name} {'-' if shift > 0 else '+'} {abs(shift):g})" if shift else name


def _functions(c: Channels, state: dict[str, Array], middle: dict[str, float], reach: dict[str, float], rate: float) -> Functions:
    """Functions of the channels frame by frame."""
    x, v, p = (state[k] - middle.get(k, 0.0) for k in ("x", "v", "p"))
    out: Functions = {("t", "t"): c.time}
    for name, f in (("x", x), ("v", v), ("p", p)):
        of = _shifted(name, middle)
        out |= {(name, of): f, (f"{name}^2", f"{of}^2"): f**2, (f"{name}^3", f"{of}^3"): f**3}
        out[f"|{name}| {name}", f"|{of}| {of}"] = np.abs(f) * f
        for share in (0.15, 0.3, 0.5, 0.7, 0.85):
            far = share * reach[name]
            out[f"edge of {name} both", f"({of} beyond -{far:.3f}, {far:.3f})"] = f - np.clip(f, -far, far)
            for side, word in ((1.0, "above"), (-1.0, "below")):
                edge = side * share * reach[name]
                over = np.clip(side * f - abs(edge), 0, None)
                at = f"{name} {word} {edge + middle.get(name, 0.0):.3f}"
                out[f"edge of {name} {word}", f"({at})"] = over
                out[f"edge of {name} {word}", f"({at})^2"] = over**2
    out["x v", f"{_shifted('x', middle)} v"] = x * v
    for speed in (0.1, 0.25, 0.5):
        out["rubbing", f"tanh(v / {speed * reach['v']:.3f})"] = np.tanh(v / (speed * reach["v"]))
    for wide in (0.15, 0.25, 0.4):
        for at in np.linspace(-0.9, 0.9, 10):
            s = (x / reach["x"] - at) / wide
            told = f"s exp(-s^2/2), s = (x {-at * reach['x'] - middle['x']:+.3f})/{wide * reach['x']:.3f}"
            out["place", f"[{told}]"] = s * np.exp(-(s**2) / 2)
    for time in (1.0, 1.4, 2.0, 2.8, 4.0):
        slow = _slow(p, time * rate)
        out["memory", f"(p of the last {time:g} s)"] = slow
        out["memory", f"(p of the last {time:g} s, from its mean in the trial)"] = slow - slow.mean()  # plates are zeroed trial by trial
    for name in ("com_z", "com_y", "com_y_dot", "ang_mom", "ang_mom_dot", "grf_y", "grf_z"):
        if c.has(name):
            out[name, name] = c[name]
    return out


def _slow(f: Array, steps: float) -> Array:
    """First-order lag of a channel over its gaps, from its first value.  steps: time constant in frames."""
    from scipy.signal import lfilter  # slow to import, and only wanted where something is left

    known = np.isfinite(f)
    g = np.interp(np.arange(len(f)), np.flatnonzero(known), f[known])
    keep = np.exp(-1.0 / steps)
    return np.asarray(lfilter([1 - keep], [1, -keep], g, zi=keep * g[:1])[0])


def fits(family: str, equation: str) -> bool:
    """Whether a family may stand in an equation.

    In those that hold x - p, x or p alone would return what was projected out: where one is fitted the other is all that is left.
    """
    if equation in ("kinematic", "vertical"):
        return family in DRIVES or family.startswith(("edge of x", "edge of v", "warp"))
    return family not in ("x", "p", "place") and not family.startswith("warp")


def line(family: str) -> str:
    """Channel whose straight line is taken out of a family where x - p stands on the left; "" for none."""
    if family.startswith(("x^", "|x|", "edge of x")):
        return "x"
    return "p" if family.startswith(("p^", "|p|", "edge of p", "memory")) else ""


def cost(family: str) -> float:
    """What a term counts."""
    return COST.get(family.split()[0], 1.0)
