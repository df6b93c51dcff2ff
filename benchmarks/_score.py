"""What a verdict got right and wrong about a study whose truth is known, and the rates over many studies.

A line is a dictionary: kind, number, truth (`Case.truth`), verdict (blocks plant and control of verdict.json), alone (effect -> base
error and noise floor with this effect alone [mm], where two share a ledger), spent, error ("" or why there is no verdict).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

Line = Mapping[str, Any]
LEDGERS = ("plant", "control")
VISIBLE = 2.0  # [1] times the noise floor: from here on an effect must be found

#: effect -> parameter of the verdict, and the key of the true size or the number that physics fixes
SIZE = {
    "ang_mom": ("beta", -1.0), "height": ("beta", 1.0), "sync": ("delay", "delay"), "offset": ("b", "b"), "drift": ("c", "c"),
    "gain": ("q", "q"), "com_bias": ("scale", "scale"), "hand": ("k", "k"), "delay": ("delay", "delay"), "lag": ("time", "time"),
    "intermittent": ("half_width", "half_width"), "ref_drift": ("rate", "rate"), "push": ("force", "force"),
    "force_scale": ("s", "s"), "integral": ("ki", "ki"), "limits": ("knee", "knee"),
}  # fmt: skip


def wilson(right: int, n: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % interval of a rate (Wilson 1927); 0 to 1 for n = 0."""
    if n == 0:
        return 0.0, 1.0
    p, w = right / n, z * z / n
    middle, half = (p + w / 2) / (1 + w), z / (1 + w) * math.sqrt(p * (1 - p) / n + w / (4 * n))
    return max(0.0, middle - half), min(1.0, middle + half)


def entries(line: Line, ledger: str) -> list[dict[str, Any]]:
    """What a ledger says is missing; nothing where it was not judged."""
    return list(line["verdict"][ledger]["missing"] or [])


def means(entry: Mapping[str, Any]) -> set[str]:
    """Every effect that an entry may stand for."""
    return {str(entry["effect"]), *entry["family"]} - {"None"}


def found(line: Line, effect: str) -> bool:
    """Whether the right ledger names a family with this effect."""
    return any(effect in means(e) for ledger in LEDGERS if effect in line["truth"][ledger] for e in entries(line, ledger))


def wrong(line: Line, ledger: str) -> list[str]:
    """Names of a ledger in whose family nothing is true there."""
    return [str(e["effect"]) for e in entries(line, ledger) if not means(e) & set(line["truth"][ledger])]


def size(line: Line, effect: str) -> float:
    """Error that the effect alone makes, in noise floors of its ledger; NaN where it could not be judged."""
    if effect in line.get("alone", {}):
        base, floor = line["alone"][effect]
    else:
        block = next(line["verdict"][ledger] for ledger in LEDGERS if effect in line["truth"][ledger])
        base, floor = block["base_error_mm"], block["noise_floor_mm"]
    return base / floor if base is not None and floor else math.nan


def visible(line: Line) -> bool:
    """Whether each effect of the study makes at least twice the noise floor."""
    return all(size(line, effect) >= VISIBLE for effect in line["truth"]["effects"])


def unexplained(line: Line) -> bool:
    """Whether either ledger says that something is left."""
    return any(line["verdict"][ledger]["unexplained"] for ledger in LEDGERS)


def accused(line: Line) -> bool:
    """Whether either ledger says anything wrong, or that something is left."""
    return unexplained(line) or any(wrong(line, ledger) for ledger in LEDGERS)


def right(line: Line) -> bool:
    """Whether both ledgers name all that is hidden, nothing else, and leave nothing."""
    judged = all(line["verdict"][ledger]["missing"] is not None for ledger in LEDGERS)
    return judged and not accused(line) and all(found(line, effect) for effect in line["truth"]["effects"])


def left_where_true(line: Line) -> bool:
    """Whether the ledger of an effect outside the catalogue says that something is left."""
    return all(bool(line["verdict"][ledger]["unexplained"]) for ledger in LEDGERS if line["truth"][ledger])


def _rate(said: str, goal: str, marks: Iterable[bool]) -> dict[str, Any]:
    marks = list(marks)
    low, high = (round(v, 6) for v in wilson(sum(marks), len(marks)))
    share = 100 * sum(marks) / len(marks) if marks else math.nan
    return {"claim": said, "goal": goal, "of": len(marks), "are": sum(marks), "%": share, "low %": 100 * low, "high %": 100 * high}


def rates(lines: Sequence[Line], catalogue: int) -> list[dict[str, Any]]:
    """Rows of the table of rates with Wilson intervals.  catalogue: how many effects could have been named."""
    done = [line for line in lines if not line["error"]]
    kind = {k: [line for line in done if line["kind"] == k] for k in ("clean", "one", "two", "outside")}
    seen = {k: [line for line in group if visible(line)] for k, group in kind.items()}
    inside = kind["clean"] + kind["one"] + kind["two"]
    named = [mark for line in done for mark in _marks(line, catalogue)]
    rows = [
        _rate("clean studies accused", "<= 1", [accused(line) for line in kind["clean"]]),
        _rate("one effect, >= 2 floors: right family named", ">= 95", [all_found(line) for line in seen["one"]]),
        _rate("one effect, >= 2 floors: both ledgers right", "", [right(line) for line in seen["one"]]),
        _rate("one effect, any size: a wrong name", "", [bool(names(line)) for line in kind["one"]]),
        _rate("two effects, each >= 2 floors: both named", ">= 90", [all_found(line) for line in seen["two"]]),
        _rate("two effects, each >= 2 floors: both ledgers right", "", [right(line) for line in seen["two"]]),
        _rate("outside the catalogue, >= 2 floors: unexplained", ">= 90", [left_where_true(line) for line in seen["outside"]]),
        _rate("outside the catalogue, any size: a wrong name", "<= 5", [bool(names(line)) for line in kind["outside"]]),
        _rate("inside the catalogue: unexplained", "<= 2", [unexplained(line) for line in inside]),
        _rate("(study, effect) pairs: an untrue effect named", "<= 1", named),
    ]
    lowered = [mark for line in done for mark in _lowered(line)]
    if lowered:
        rows.append(_rate("(study, effect) pairs: an untrue effect lowers the error", "<= 5", lowered))
    unjudged = [any(line["verdict"][ledger]["missing"] is None for ledger in LEDGERS) for line in done]
    return [*rows, _rate("a ledger not judged", "", unjudged), _rate("no verdict: an error", "", [bool(line["error"]) for line in lines])]


def all_found(line: Line) -> bool:
    """Whether every effect is named in its ledger."""
    return all(found(line, effect) for effect in line["truth"]["effects"])


def names(line: Line) -> list[str]:
    """Wrong names of both ledgers."""
    return [name for ledger in LEDGERS for name in wrong(line, ledger)]


def _marks(line: Line, catalogue: int) -> list[bool]:
    """One mark for each effect of the catalogue that is not true: whether it is named."""
    bad = len(names(line))
    return [True] * bad + [False] * max(catalogue - len(line["truth"]["effects"]) - bad, 0)


def _lowered(line: Line) -> list[bool]:
    """For each candidate outside every true family, where the verdict lists any: whether the 95 % interval of its fall is above 0."""
    out = []
    for ledger in LEDGERS:
        for one in line["verdict"][ledger].get("candidates", []):
            if not means(one) & set(line["truth"]["effects"]):
                out.append(one["fall_low_mm"] > 0)
    return out


def of_effects(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """Row per effect: how many there were and were found, how wide its family was named, and its size in parts of the true one."""
    rows = []
    done = [line for line in lines if not line["error"]]
    for effect in sorted({e for line in done for e in line["truth"]["effects"] if line["truth"]["inside"]}):
        mine = [line for line in done if effect in line["truth"]["effects"]]
        seen = [line for line in mine if size(line, effect) >= VISIBLE]
        hits = [e for line in mine for ledger in LEDGERS for e in entries(line, ledger) if effect in means(e)]
        ratios = sorted(r for line in mine if (r := _ratio(line, effect)) is not None)
        low, high = wilson(sum(found(line, effect) for line in seen), len(seen))
        rows.append({
            "effect": effect, "studies": len(mine), ">= 2 floors": len(seen), "found there": sum(found(line, effect) for line in seen),
            "low %": 100 * low, "high %": 100 * high, "found in all": sum(found(line, effect) for line in mine),
            "family": sum(len(means(e)) for e in hits) / len(hits) if hits else math.nan,
            "size / true": ratios[len(ratios) // 2] if ratios else math.nan,
        })  # fmt: skip
    return rows


def _ratio(line: Line, effect: str) -> float | None:
    """Found size over the true one, where it was named by its own id."""
    name, key = SIZE.get(effect, ("", ""))
    true = key if isinstance(key, float) else line["truth"]["effects"][effect].get(key)
    for ledger in LEDGERS:
        for entry in entries(line, ledger):
            if entry["effect"] == effect and true and name in entry["parameters"]:
                return float(entry["parameters"][name]["value"]) / float(true)
    return None


def power(lines: Sequence[Line]) -> list[dict[str, Any]]:
    """One row per study with a single effect of the catalogue: effect, size in noise floors, and whether it was found."""
    alone = [line for line in lines if line["kind"] == "one" and not line["error"]]
    rows = [(effect, size(line, effect), found(line, effect)) for line in alone for effect in line["truth"]["effects"]]
    return [{"effect": e, "floors": s, "found": f} for e, s, f in sorted(rows) if s == s]
