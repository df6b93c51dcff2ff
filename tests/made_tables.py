"""Tables of a made study for the tests of figures and report: a body that obeys the model exactly, with sensor noise on top."""

from typing import Any

import numpy as np
import pandas as pd

from plumbline import tables
from plumbline.config import with_defaults
from plumbline.exclusions import exclusions
from plumbline.fit import identify
from plumbline.ladder import Said, ladder, verdict
from plumbline.residuals import residuals

RATE = 100.0  # [Hz]
W2 = 9.0  # [1/s2]
MASS = 70.0  # [kg]
CONFIG = with_defaults({})


def study(subjects: int = 1, trials: int = 3, *, pushes: bool = True, names: str = "") -> dict[str, Any]:
    """Every table of a study, and its verdict.  names: put into each trial's name."""
    keys = [
        {"trial": f"sub-{s:02d}_task-lateral{names}_run-{t:02d}", "subject": f"sub-{s:02d}", "task": "lateral", "condition": ""}
        for s in range(1, subjects + 1) for t in range(1, trials + 1)
    ]  # fmt: skip
    out: dict[str, Any] = {
        "signals": pd.concat([_signals(k, i) for i, k in enumerate(keys)], ignore_index=True) if keys else tables.empty("signals"),
        "coverage": _full("coverage", [_coverage(k) for k in keys]),
        "trials": _full("trials", [_trial(k) for k in keys]),
        "pushes": _full("pushes", [_push(k, p) for k in keys for p in (2.0, 6.0)] if pushes else []),
        "loci": _full("loci", [r for k in keys for r in _loci(k)] if pushes else []),
    }
    return finish(out)


def finish(out: dict[str, Any]) -> dict[str, Any]:
    """Add what follows from the signals: fit, heldout, residuals, where, ladder, exclusions, verdict; and a made-up controller."""
    given = [out[k] for k in ("signals", "pushes", "loci", "coverage")]
    fit, heldout = identify(*given, CONFIG["evaluation"])
    out["fit"], out["heldout"] = _typed("fit", fit), _typed("heldout", heldout)
    frames, where = residuals(*given, out["heldout"], CONFIG["evaluation"])
    out["residuals"], out["where"] = _typed("residuals", frames), _typed("where", where)
    out["ladder"] = _typed("ladder", ladder(out["heldout"]))
    out |= controller(out["loci"])
    out["exclusions"] = _typed("exclusions", exclusions(out["trials"], []))
    out["verdict"] = verdict(Said(out["ladder"], out["coverage"], out["heldout"]), CONFIG["evaluation"])
    return out


def controller(loci: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Tables trust, rls, clusters, choice, controller as two stages would leave them; the numbers are made up.

    Every locus that recovers is at a limit for 0.3 s; one that falls, always.  Two methods see k1 = 4, least squares 3.6.
    """
    groups = loci[["subject", "task", "condition"]].drop_duplicates().to_dict("records")
    rows = [{str(k): v for k, v in r.items()} for r in loci.to_dict("records")]
    tried = ({"number": 1, "score": -1.6, "chosen": True}, {"number": 2, "score": -1.7, "gain_se": 0.1})
    return {
        "trust": _full("trust", [part for r in rows for part in _regimes(r)]),
        "rls": pd.concat([_passes(r) for r in rows], ignore_index=True) if rows else tables.empty("rls"),
        "clusters": _full("clusters", [_member(r, i) for i, r in enumerate(rows)]),
        "choice": _full("choice", [g | one for g in groups for one in tried]),
        "controller": _full("controller", [g | law for g in groups for law in _laws(len(loci) // len(groups))]),
    }


def _regimes(locus: dict[str, Any]) -> list[dict[str, Any]]:
    about = {k: locus[k] for k in ("trial", "subject", "task", "condition", "locus")}
    switch = locus["start"] + 0.3
    first = {"part": 1, "regime": locus["side"], "start": locus["start"], "end": locus["end"], "source": "start"}
    if locus["kind"] == "falling":
        return [about | first]
    later = {"part": 2, "regime": "inside", "start": switch, "end": locus["end"], "source": "found", "found": switch, "rls": switch - 0.012}
    return [about | first | {"end": switch}, about | later]


def _passes(locus: dict[str, Any]) -> pd.DataFrame:
    """Estimates that come from far away at the start of either pass."""
    time = np.arange(locus["start"], locus["end"], 1 / RATE)
    late, left = time - time[0] + 0.01, time[-1] - time + 0.01
    columns: dict[str, Any] = {"frame": np.round(time * RATE).astype(int), "time": time, "stray": 0.1}
    for name, value in (("omega", 3.0), ("k1", 4.0), ("k2", 0.9)):
        columns |= {f"{name}_forward": value - 1 / late, f"{name}_backward": value + 5 / left, f"{name}_sd": 1 / left}
    columns["omega_sd"] = np.where(left < 0.5, np.inf, columns["omega_sd"])
    return pd.DataFrame({k: locus[k] for k in ("trial", "subject", "locus")} | columns)


def _member(locus: dict[str, Any], number: int) -> dict[str, Any]:
    about = {k: locus[k] for k in ("trial", "subject", "task", "condition", "locus", "kind")} | {"reach": 0.05 + 0.01 * number}
    if locus["kind"] == "falling":
        return about | {"note": "falls: its ZMP only shows the limit"}
    omega = 3.0 + 0.05 * (-1) ** number
    return about | {"omega": omega, "omega_low": omega - 0.3, "omega_high": omega + 0.3, "cluster": 1, "share": 1.0, "gains": True}


def _laws(loci: int) -> list[dict[str, Any]]:
    base: dict[str, Any] = {"loci": loci, "feedback_sd": 3e-3, "q1_real": 1.35, "q1_imag": 1.0, "q2_real": 1.35, "q2_imag": -1.0}
    values = {"omega": (3.0, 0.05), "reference": (0.002, 5e-4), "k2": (0.9, 0.03), "limit_left": (-0.1, 1e-4), "limit_right": (0.09, 1e-4)}
    for name, (value, half) in values.items():
        base |= {name: value, f"{name}_low": value - half, f"{name}_high": value + half}
    plain = base | {"k1": 4.0, "k1_low": 3.9, "k1_high": 4.1}
    late = plain | {"k1_low": 3.5, "k1_high": 4.5, "delay": 0.004, "delay_low": 0.0, "delay_high": 0.021, "error": 8e-4}
    naive = base | {"k1": 3.6, "k1_low": 3.55, "k1_high": 3.65, "warning": "least squares: for comparison only"}
    return [
        plain | {"method": "output error", "error": 8e-4}, late | {"method": "output error with delay"}, plain | {"method": "instruments"},
        naive | {"method": "saturation"},
    ]  # fmt: skip


def _typed(name: str, frame: pd.DataFrame) -> pd.DataFrame:
    return frame if len(frame.columns) else tables.empty(name)


def _full(name: str, rows: list[dict[str, Any]]) -> pd.DataFrame:
    """A table whose columns that are not given are empty, NaN, 0 or False."""
    blank = {"str": "", "int": 0, "float": np.nan, "bool": False}
    every = [{c.name: blank[c.kind] for c in tables.TABLES[name]} | r for r in rows]
    return pd.DataFrame(every, columns=[c.name for c in tables.TABLES[name]]) if rows else tables.empty(name)


def _signals(key: dict[str, Any], seed: int) -> pd.DataFrame:
    """Sines of the ZMP and the CoM that eq. 1 gives for them: amplitude w2/(w2 + W2)."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(10 * RATE)) / RATE
    columns: dict[str, Any] = {}
    for axis, size in (("x", 0.04), ("y", 0.03)):
        speeds, phases = np.array([1.1, 2.3, 3.9]), rng.uniform(0, 6, 3)
        waves = size * np.sin(np.outer(t, speeds) + phases) / np.arange(1, 4)
        p, x, a = waves.sum(1), (waves * W2 / (W2 + speeds**2)).sum(1), -(waves * W2 * speeds**2 / (W2 + speeds**2)).sum(1)
        columns |= {f"zmp_{axis}": p + rng.normal(0, 3e-4, len(t)), f"com_{axis}": x + rng.normal(0, 2e-4, len(t))}
        columns |= {f"grf_{axis}": MASS * a + rng.normal(0, 1, len(t)), f"com_ddot_{axis}": a, f"com_lp_{axis}": x}
    columns |= {"zmp_z": 0.0, "com_z": 1.0 + rng.normal(0, 1e-4, len(t)), "grf_z": MASS * 9.81 + rng.normal(0, 1, len(t))}
    columns |= {"grf_left_z": 300.0, "grf_right_z": columns["grf_z"] - 300.0, "limit_left": -0.2, "limit_right": 0.2}
    columns |= {"limit_back": -0.1, "limit_front": 0.15, "frame": np.arange(len(t)), "time": t, **key}
    frame = pd.DataFrame(index=np.arange(len(t)), columns=[c.name for c in tables.TABLES["signals"]], dtype=float)
    return frame.assign(**{c.name: False for c in tables.TABLES["signals"] if c.kind == "bool"}).assign(**columns)


def _coverage(key: dict[str, Any]) -> dict[str, Any]:
    said = {"com_method": "table", "marker_set": "plug-in-gait", "mass_share": 1.0, "mass": MASS, "height_com": 1.0}
    return {**key, **said, "lab_distance": 0.012, "support": "markers", "cutoff": 2.0}


def _trial(key: dict[str, Any]) -> dict[str, Any]:
    said = {"run": "01", "files": f"{key['trial']}.c3d", "rate": RATE, "force_rate": 1000.0, "frames": 1000, "duration": 10.0}
    said |= {"markers": 39, "plates": 2, "filled": 12, "axes": "x=+X y=+Y z=+Z", "axes_from": "gravity and feet", "force_sign": -1.0}
    return {**key, **said, "shear_sign": 1.0, "mass": MASS, "notes": '["plate 2: offset of 3 N"]'}


def _push(key: dict[str, Any], start: float) -> dict[str, Any]:
    return {**key, "start": start, "end": start + 0.2, "source": "event", "peak": 60.0}


def _loci(key: dict[str, Any]) -> list[dict[str, Any]]:
    spans = ((2.2, 6.0, "recovering", "left"), (6.2, 9.9, "falling", "right"))
    return [
        {**key, "locus": i, "start": a, "end": b, "start_frame": round(a * RATE), "end_frame": round(b * RATE), "kind": kind, "side": side,
         "source": "event", "reference": 0.0}
        for i, (a, b, kind, side) in enumerate(spans, 1)
    ]  # fmt: skip
