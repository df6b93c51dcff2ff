"""The catalogue of effects in words: for the command line and for docs/effects.md."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from plumbline.effects import Effect, Parameter
from plumbline.effects._effect import LEDGERS

LEDGER = {
    "plant": "body and instruments: what x'' = w2 (x - p) lacks",
    "control": "controller: what p = clip(d + k1 (x - d) + k2 x') lacks",
    "robot": "robot: what the ZMP models of a robot lack",
}
HEAD = """# Effects

Written by `plumbline docs` from the files in `plumbline/effects/`; do not edit. One file is one effect. The plant without effects is
$`\\ddot x = \\omega^2 (x - p)`$, its kinematic side $`\\ddot x = F_x/m`$; a plant effect says what it adds to the right side of each.
x is the CoM, p the ZMP, z the CoM's height above the plates, m the mass, F the ground reaction, L the angular momentum about the CoM
(positive turning +z towards +x). Bounds are what is physically possible: an estimate outside them is refused, and said so.
An effect whose channels are absent is never named.
"""


def listing(effects: Mapping[str, Effect], ledger: str | None, own: frozenset[str]) -> Iterator[str]:
    """Lines of a table of the catalogue: one block per effect.  own: ids of the study's own effects, marked with a star."""
    width = max(map(len, effects), default=0) + 2
    for one in LEDGERS if ledger is None else (ledger,):
        mine = {k: e for k, e in effects.items() if e.ledger == one}
        if mine:
            yield from ("", LEDGER[one])
        for name, effect in mine.items():
            pad = " " * (width + 2)
            yield f"  {name + '*' * (name in own):<{width}}{effect.title}"
            yield f"{pad}needs {', '.join(effect.needs)}"
            yield from (f"{pad}{parameter(p)}" for p in effect.parameters)
            if effect.confounded or effect.twin:
                yield f"{pad}may look like {', '.join(_alike(effect))}"
    if own & set(effects):
        yield from ("", "* this study's own")


def full(effect: Effect) -> Iterator[str]:
    """All that is known of one effect, line by line."""
    yield f"{effect.id}: {effect.title}"
    rows = [("ledger", LEDGER[effect.ledger]), ("adds", effect.equation), ("source", effect.source), ("needs", ", ".join(effect.needs))]
    rows += [("parameter", parameter(p)) for p in effect.parameters]
    rows += [("may look like", ", ".join(_alike(effect)) or "nothing listed"), ("told apart by", effect.separated or "not known")]
    rows += [("note", note) for note in _notes(effect)]
    yield from (f"  {name:<14}{text}" for name, text in rows)


def page(effects: Mapping[str, Effect]) -> str:
    """docs/effects.md."""
    out = [HEAD]
    for ledger in LEDGERS:
        mine = {k: e for k, e in effects.items() if e.ledger == ledger}
        if mine:
            out += [f"## {LEDGER[ledger].capitalize()}\n", *_table(mine), ""]
            out += [line for effect in mine.values() for line in _section(effect)]
    return "\n".join(out).rstrip() + "\n"


def _table(effects: Mapping[str, Effect]) -> Iterator[str]:
    yield "| id | what | parameters | needs | may look like |"
    yield "|---|---|---|---|---|"
    for name, e in effects.items():
        numbers = ", ".join(f"{p.name} [{p.unit}]" for p in e.parameters)
        yield f"| [{name}](#{name}) | {e.title} | {numbers} | {', '.join(e.needs)} | {', '.join(_alike(e))} |"


def _section(effect: Effect) -> Iterator[str]:
    yield from (f"### {effect.id}", "", f"{effect.title}: adds $`{effect.equation}`$", "")
    yield from (f"- {parameter(p)}" for p in effect.parameters)
    yield from (f"- needs: {', '.join(effect.needs)}", f"- source: {effect.source}")
    if _alike(effect):
        yield f"- may look like: {', '.join(_alike(effect))}"
    yield f"- told apart by: {effect.separated}"
    yield from (f"- {note}" for note in _notes(effect))
    yield ""


def parameter(p: Parameter) -> str:
    """`delay [s]: -0.2 to 0.2; named from 0.003 on`."""
    ends = ("" if np.isneginf(p.lower) else f"{p.lower:g}", "" if np.isposinf(p.upper) else f"{p.upper:g}")
    known = {(True, True): f"{ends[0]} to {ends[1]}", (True, False): f"from {ends[0]} on", (False, True): f"up to {ends[1]}"}
    out = f"{p.name} [{p.unit}]: {known.get((bool(ends[0]), bool(ends[1])), 'any value')}"
    if p.physics is not None:
        out += f"; physics says {p.physics:g}" + (f", believed within {p.within:g}" if np.isfinite(p.within) else "")
    return out + (f"; named from {p.matters:g} on" if p.matters else "")


def _alike(effect: Effect) -> list[str]:
    """What an effect may look like, its twin first."""
    twin = {"": [], "w2": ["another w2"]}.get(effect.twin, [effect.twin])
    return [*twin, *(k for k in effect.confounded if k not in twin)]


def _notes(effect: Effect) -> Iterator[str]:
    if effect.twin:
        yield f"no recording of motion alone can tell it from {_alike(effect)[0]}: never searched for, only named beside it"
    if not effect.searched:
        yield "it would explain any fault of the markers: never searched for, judged where `models:` has it"
    if effect.settled:
        yield "always fitted and taken out before anything else is judged"


def separated(family: Sequence[str], effects: Mapping[str, Effect]) -> str:
    """Recordings that would tell the members of a family apart, as the catalogue has them."""
    ways = dict.fromkeys(effects[k].separated for k in family if k in effects and effects[k].separated)
    return f"{' or '.join(family)}: {'; '.join(ways)}"
