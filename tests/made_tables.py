"""Tables of a made study for the tests of figures and report: a body that obeys the model exactly, with sensor noise on top."""

from typing import Any

import numpy as np
import pandas as pd

from plumbline import tables
from plumbline.config import with_defaults
from plumbline.exclusions import exclusions
from plumbline.fit import identify
from plumbline.ladder import ladder, verdict
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
    """Add what follows from the signals: fit, heldout, residuals, where, ladder, exclusions, verdict."""
    given = [out[k] for k in ("signals", "pushes", "loci", "coverage")]
    fit, heldout = identify(*given, CONFIG["evaluation"])
    out["fit"], out["heldout"] = _typed("fit", fit), _typed("heldout", heldout)
    frames, where = residuals(*given, out["heldout"], CONFIG["evaluation"])
    out["residuals"], out["where"] = _typed("residuals", frames), _typed("where", where)
    out["ladder"] = _typed("ladder", ladder(out["heldout"]))
    out["exclusions"] = _typed("exclusions", exclusions(out["trials"], []))
    out["verdict"] = verdict(out["ladder"], CONFIG["evaluation"], out["coverage"], out["heldout"])
    return out


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
