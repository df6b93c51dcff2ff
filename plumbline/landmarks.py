"""Which anatomical landmark a marker label stands for, and whether a table's row may be used between two of them.

A row of a segment table holds only for its own landmarks: de Leva's trunk from the suprasternal notch (0.4486) and from C7
(0.5138) differ by 35 mm of trunk CoM.
"""

import re
from collections.abc import Iterable, Sequence

from plumbline.errors import PlumblineError
from plumbline.segments import DE_LEVA, LANDMARKS, TABLES, Numbers, Row

#: label without side -> landmarks it may mean; several where labs differ
_LABELS: dict[str, tuple[str, ...]] = {
    **{name: (name,) for name in LANDMARKS},
    **dict.fromkeys(("C7", "CERVICALE"), ("CERV",)),
    **dict.fromkeys(("CLAV", "IJ", "JN", "SJN", "SUPRASTERNALE", "MANUBRIUM"), ("SUPR",)),
    **dict.fromkeys(("STRN", "PX", "XP", "XIPHOID"), ("XYPH",)),
    **dict.fromkeys(("VERTEX", "HEADTOP"), ("VERT",)),
    **dict.fromkeys(("HIP", "HIPC", "HIPCENTER", "HIPCENTRE", "HJCREG"), ("HJC",)),
    **dict.fromkeys(("MIDHIP", "MHIP"), ("MIDH",)),
    **dict.fromkeys(("KNE", "KNEE"), ("KJC",)),
    **dict.fromkeys(("ANK", "ANKLE"), ("AJC", "LMAL")),
    **dict.fromkeys(("SHO", "SHOULDER"), ("SJC",)),
    **dict.fromkeys(("ELB", "ELBOW"), ("EJC",)),
    **dict.fromkeys(("WRI", "WRIST"), ("WJC", "STYL")),
    **dict.fromkeys(("FIN", "HAND"), ("MET3", "DAC3")),
    **dict.fromkeys(("HEE", "CALC", "CAL", "FCC"), ("HEEL",)),
    **dict.fromkeys(("TOE", "TOETIP"), ("TTIP",)),
    **dict.fromkeys(("MAL", "LATMAL", "LMALLEOLUS"), ("LMAL",)),
}
#: the middle of a left and a right landmark
_MIDDLE = {"HJC": "MIDH", "SJC": "MIDS"}


def landmarks_of(labels: Sequence[str]) -> tuple[str, ...] | None:
    """Landmarks that the mean of these labels may stand for; None where the labels tell nothing."""
    found = [_one(label) for label in labels]
    if len(labels) == 1:
        return found[0][1] if found[0] else None
    known = [f for f in found if f]
    if len(known) != len(labels):
        return None
    sides, names = {side for side, _ in known}, {names for _, names in known}
    if len(names) != 1:
        return None
    both = tuple(_MIDDLE[n] for n in names.pop() if n in _MIDDLE)
    return both if sides == {"R", "L"} and both else None


def _one(label: str) -> tuple[str, tuple[str, ...]] | None:
    """Side ("R", "L" or "") and landmarks of one label."""
    clean = re.sub(r"[^A-Z0-9]", "", label.upper())
    if clean in _LABELS:
        return "", _LABELS[clean]
    for word in ("RIGHT", "LEFT", "R", "L"):
        for base in (clean.removeprefix(word), clean.removesuffix(word)):
            if base != clean and base in _LABELS:
                return word[0], _LABELS[base]
    return None


def check_row(where: str, proximal: Sequence[str], distal: Sequence[str], name: str, row: Row) -> list[str]:
    """Refuse a table row on other landmarks; notes for labels that do not say what they are.

    where: file and segment, for the message.  Raises PlumblineError.
    """
    notes = []
    for end, labels, want in (("proximal", proximal, row.proximal), ("distal", distal, row.distal)):
        have = landmarks_of(labels)
        if have is None:
            notes.append(f"{where}: {end} {list(labels)} is taken as {want} ({LANDMARKS[want]}) for {name}")
        elif want not in have:
            fits = _fitting(name, proximal, distal)
            advice = f"use {fits}" if fits else "give own mass, com and gyration, or other markers"
            raise PlumblineError(
                f"{where}, key 'table': {name} runs from {row.proximal} to {row.distal}, but {end} {list(labels)} is "
                f"{' or '.join(have)}; {advice}"
            )
    return notes


def _fitting(name: str, proximal: Sequence[str], distal: Sequence[str]) -> str:
    """Rows of the same body part whose landmarks are those of the labels, joined by ' or '."""
    table, _, segment = name.partition("/")
    mass = TABLES[table][segment].male.mass
    same = [n for n, r in TABLES[table].items() if r.male.mass == mass and _allows(r, proximal, distal)]
    return " or ".join(f"{table}/{n}" for n in same)


def _allows(row: Row, proximal: Sequence[str], distal: Sequence[str]) -> bool:
    ends = ((landmarks_of(proximal), row.proximal), (landmarks_of(distal), row.distal))
    return all(have is None or want in have for have, want in ends)


def lookalike(where: str, proximal: Sequence[str], distal: Sequence[str], own: Numbers) -> list[str]:
    """A warning where own numbers are those of a row for other landmarks than the labels'."""
    like = {n: r for n, r in DE_LEVA.items() if any(_equal(own, x) for x in (r.male, r.female))}
    if not like or any(_allows(r, proximal, distal) for r in like.values()):
        return []
    name, row = next(iter(like.items()))
    fits = _fitting(f"de-leva-1996/{name}", proximal, distal)
    instead = f"; for these markers the table has {fits}" if fits else ""
    return [
        f"{where}: mass {own.mass:g} and com {own.com:g} look like de-leva-1996/{name}, which runs from {row.proximal} to "
        f"{row.distal}, not between {list(proximal)} and {list(distal)}{instead}"
    ]


def _equal(own: Numbers, other: Numbers) -> bool:
    return abs(own.mass - other.mass) < 6e-4 and abs(own.com - other.com) < 6e-4


def base_names(labels: Iterable[str]) -> dict[str, str]:
    """Label without a subject prefix ('Anna:LASI' -> 'LASI') -> label as recorded; the plain label wins."""
    out: dict[str, str] = {}
    for label in labels:
        out.setdefault(label.rsplit(":", 1)[-1], label)
    return out | {label: label for label in labels}
