"""Which figure is drawn by which module, from which tables."""

from typing import NamedTuple


class Sheet(NamedTuple):
    """module: here.  tables: names of the tables `draw` takes."""

    module: str
    tables: tuple[str, ...]


FIGURES = {
    "fig3": Sheet("tracks", ("tracks",)),
    "fig4": Sheet("stability", ("stability",)),
    "cohort": Sheet("cohort", ("people", "holds")),
}
"""Figs. 3 and 4 of the paper, and the forty people."""
