"""What the verdict says of one axis and ledger, in words: what is missing, how sure that is, what to record and what to type next."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from plumbline.effects import Effect
from plumbline.report.words import number, plural
from plumbline.shapes import SHAPES

Block = Mapping[str, Any]
Effects = Mapping[str, Effect]

MM = 0.5  # [m] lengths below this are shown in mm
SPEED = 0.1  # [m/s] speeds below this are shown in mm/s
SMALL_Q = 0.001  # [1] smaller rates are said to be smaller


class Item(NamedTuple):
    """One entry of `missing`.  head: its name.  lines: sentences on it."""

    head: str
    lines: list[str]


class Ledger(NamedTuple):
    """What is said of one ledger.

    tone: missing, unexplained, none or unjudged.  head: the verdict in a few words.  text: what that means.  items: what is missing.
    apart: recordings that tell members of a family apart.  commands: to type next.  refused: impostors.
    cannot: effects without their channels.
    """

    tone: str
    head: str
    text: str
    items: list[Item]
    apart: list[str]
    commands: list[str]
    refused: list[str]
    cannot: list[tuple[str, str]]


def ledger(block: Block, effects: Effects, auto: bool, judged: str = "trials") -> Ledger:
    """A block of the verdict in words.

    block: `plant` or `control` of one axis.  effects: the catalogue, for titles and what physics says.  auto: models climb by themselves.
    judged: what was left out, trials or loci.
    """
    missing: Sequence[Block] = block["missing"] or []
    cannot = [(name, why) for name, why in sorted((block.get("cannot_judge") or {}).items())]
    tone = _tone(block)
    return Ledger(
        tone, _head(tone, missing, effects, bool(block["noise_floor_mm"])), _text(tone, block, len(cannot), judged),
        [_item(m, missing, effects, auto) for m in missing],
        list(block.get("separate", [])),
        [] if auto else [f"plumbline add {m['effect']}" for m in missing if _to_add(m)],
        [_refused(r) for r in block.get("refused") or []], cannot,
    )  # fmt: skip


def _tone(block: Block) -> str:
    if block["missing"] is None:
        return "unjudged"
    return "unexplained" if block["unexplained"] else "missing" if block["missing"] else "none"


def _to_add(entry: Block) -> bool:
    return bool(entry["effect"]) and not entry["in_model"]


def _head(tone: str, missing: Sequence[Block], effects: Effects, sure: bool) -> str:
    """The verdict in a few words.  sure: the noise floor is known, so nothing is a claim."""
    names = " and ".join(_name(m, effects) for m in missing)
    if tone == "unexplained":
        return (
            f"Missing: {names}, and something that no listed effect explains"
            if names
            else "Something is missing that no listed effect explains"
        )
    nothing = "Nothing is missing" if sure else "Nothing was found to be missing"
    return {"unjudged": "Not judged", "none": nothing, "missing": f"Missing: {names}"}[tone]


def _name(entry: Block, effects: Effects) -> str:
    """The effect in words; where only the family can be told, its members."""
    return titled(entry["effect"], effects) if entry["effect"] else listed(entry["family"], "or")


def titled(effect: str, effects: Effects) -> str:
    """Title and id; an effect without a file has its id alone."""
    return f"{effects[effect].title} ({effect})" if effect in effects else effect


def listed(names: Sequence[str], word: str) -> str:
    """a, b or c."""
    return f" {word} ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def _text(tone: str, block: Block, cannot: int, judged: str) -> str:
    if tone == "unjudged":
        return "Not judged, so nothing is said of what is missing. It does not mean that nothing is."
    if tone == "unexplained":
        return _left(str(block["description"]))
    if tone == "missing":
        return ""
    said = f"No effect that these data can judge lowers the error on {judged} left out enough to be named"
    known = ", and what is left is what noise and a usual body model leave." if judged == "trials" else "."
    said += known if block["noise_floor_mm"] else ". The noise floor is not known, so something small may be hidden."
    return said + (f" {plural(cannot, 'effect')} could not be judged, see below." if cannot else "")


def _left(description: str) -> str:
    """Where something is left and what it looks like."""
    said = description.removesuffix("; no listed effect explains it").strip().rstrip(".")
    if not said:
        return "Where it lies is not known."
    return f"It shows {said}." if said.startswith("in ") else f"{said[0].upper()}{said[1:]}."


# -- one effect -------------------------------------------------------------------------------------------------------


def _item(entry: Block, missing: Sequence[Block], effects: Effects, auto: bool) -> Item:
    effect = entry["effect"]
    lines = [_fall(entry, len(missing) > 1), *(value(k, v, effects.get(effect or "")) for k, v in entry["parameters"].items())]
    others = [k for k in entry["family"] if k != effect]
    if not effect:
        lines.append("These data cannot tell which of them it is.")
    elif others:
        lines.append(f"These data cannot tell it from {listed([titled(k, effects) for k in others], 'or')}.")
    else:
        lines.append("No other effect of the catalogue would explain it as well.")
    lines.append(_sure(entry.get("q_value")))
    if effect and entry["in_model"]:
        lines.append("It was added by itself (models: auto)." if auto else "The configured model has it.")
    head = titled(effect, effects) if effect else " or ".join(titled(k, effects) for k in entry["family"])
    return Item(head, [line for line in lines if line])


def _fall(entry: Block, several: bool) -> str:
    before, after = number(entry["error_before_mm"]), number(entry["error_after_mm"])
    if not before or not after:
        return ""
    if several:
        return f"With all that is missing the error is {after} mm; without this one it would be {before} mm."
    return f"With it the error falls to {after} mm."


def _sure(q: float | None) -> str:
    if q is None or q != q:
        return ""
    return f"How often a name as sure as this is wrong: q {rate(q)} (false discovery rate over the catalogue)."


def rate(q: float) -> str:
    """A false discovery rate; very small ones are said to be small."""
    return f"< {SMALL_Q:g}" if q < SMALL_Q else f"= {q:.2g}"


def sizes(entry: Block) -> str:
    """Parameters of an entry with their intervals and the error with it, in a row."""
    said = [value(k, v, None).rstrip(".") for k, v in entry["parameters"].items()]
    return ", ".join([*said, f"error with it {number(entry['error_after_mm'])} mm"])


def value(name: str, said: Block, effect: Effect | None) -> str:
    """Size of a parameter, its interval, and what physics says."""
    shown, factor, unit = scaled(said["value"], said["unit"])
    out = f"{name} = {shown}{unit}"
    low, high = said.get("ci95") or (None, None)
    if low is not None and high is not None and low == low and high == high:
        out += f" (95 % interval {minus(number(factor * low))} to {minus(number(factor * high))}{unit})"
    physics = next((p.physics for p in effect.parameters if p.name == name), None) if effect else None
    if physics is None:
        return out + "."
    out += f"; physics says {minus(f'{physics:g}')}."
    outside = low is not None and high is not None and not low <= physics <= high
    return out + (" The interval counts chance from trial to trial, not what a body model is wrong by." if outside else "")


def scaled(value: float, unit: str) -> tuple[str, float, str]:
    """A value as text, the factor to its shown unit, and that unit after a space; empty for pure numbers.  value: [unit], SI."""
    if unit in ("1", ""):
        return minus(number(value)), 1.0, ""
    least = {"m": MM, "s": 1.0, "m/s": SPEED}.get(unit, 0.0)
    factor, shown = (1e3, f"m{unit}") if abs(value) < least else (1.0, unit)
    return minus(number(factor * value)), factor, f" {shown}"


def minus(text: str) -> str:
    """With a minus sign that is as long as a plus sign."""
    return text.replace("-", "\u2212", 1) if text.startswith("-") else text


def _refused(one: Block) -> str:
    """An impostor and why it was not believed."""
    names = " with ".join(SHAPES[k].title if k in SHAPES else k for k in one["effects"])
    error = number(one["error_mm"])
    would = f"would bring the error to {error} mm" if error else "would lower the error"
    return f"{names} {would}. Refused: {one['reason'].rstrip('.')}."
