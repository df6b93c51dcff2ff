"""Figures: each module draws one, `draw(tables) -> Figure`; every number drawn stands in the tables it is given."""
