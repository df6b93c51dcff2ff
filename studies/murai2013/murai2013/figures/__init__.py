"""Which figure of the paper is drawn by which module, from which tables, with what about it."""

from typing import NamedTuple


class Sheet(NamedTuple):
    """module: here.  tables: names of the tables `draw` takes.  about: its other arguments."""

    module: str
    tables: tuple[str, ...]
    about: dict[str, str]


FIGURES = {
    "fig2": Sheet("regions", ("portrait",), {}),
    "fig5": Sheet("measured", ("tracks",), {}),
    "fig6": Sheet("passes", ("passes", "switches"), {"figure": "fig6"}),
    "fig7": Sheet("passes", ("passes", "switches"), {"figure": "fig7"}),
    "fig8": Sheet("passes", ("passes", "switches"), {"figure": "fig8"}),
    "fig9": Sheet("clusters", ("loci", "groups"), {"condition": "free"}),
    "fig10": Sheet("clusters", ("loci", "groups"), {"condition": "held"}),
    "fig11": Sheet("identified", ("portrait", "tracks"), {"condition": "free"}),
    "fig12": Sheet("identified", ("portrait", "tracks"), {"condition": "held"}),
}
"""Figures of the paper; the comparison, which alone sees the truth, is not among them."""

NAMES = {"free": "A, height of the CoM free", "held": "B, height of the CoM held"}
"""Conditions as the paper calls them."""
