"""A first file for an effect of the user's own: a full member of the catalogue at once, to be changed by hand."""

import keyword
from collections.abc import Iterator
from pathlib import Path

from plumbline.effects import catalogue
from plumbline.errors import PlumblineError

#: the file that the README shows; NAME stands for the effect's id
TEMPLATE = '''"""NAME: something at hand height rubs against the body. An example: put your own physics in its place."""

import numpy as np
from plumbline.effects import Effect, Parameter


def force(c):  # what one newton adds to x'' = F/m [m/s2], one value per frame, as a column
    return -np.tanh(c.com_dot_x / 0.05)[:, None] / c.mass


def columns(c):  # what one newton adds to x'' = w2 (x - p): the same, with the lever of a force at 1.1 m
    return force(c) * 1.1 / c.height


# c.com_x, c.com_z, c.zmp_x, c.grf_x, c.grf_z, c.ang_mom, c.time and every other column of results/signals are arrays, in SI units
# (_x: the axis that is judged); c.zmp_x_dot, c.zmp_x_ddot ... their derivatives; c.mass, c.height (of the CoM), c.w2, c.g numbers.
# Two parameters need two columns: np.column_stack([a, b]). An effect that leaves x'' = F/m alone needs no force.
EFFECT = Effect(
    title="Something rubs", ledger="plant", equation=r"-\\frac{h_e}{m z} f \\tanh(\\dot x / v)", source="this file",
    needs=("com_x", "grf_x", "com_z"), parameters=(Parameter("f", "N", lower=0.0, upper=100.0),), columns=columns, force=force,
    separated="the same task without it",
)  # fmt: skip
'''


def write(folder: Path, name: str) -> Iterator[str]:
    """Write effects/NAME.py in a study; yields lines to print.

    Raises PlumblineError for a name that is no identifier, that the library has, or whose file is there.
    """
    if not (name.isidentifier() and name.isascii() and name == name.lower()) or keyword.iskeyword(name) or name.startswith("_"):
        raise PlumblineError(f"'{name}': an effect's name is made of small letters, digits and _, and begins with a letter, as in ang_mom")
    if name in catalogue():
        raise PlumblineError(f"the library has an effect '{name}': `plumbline effects {name}` shows it; take another name")
    file = folder / "effects" / f"{name}.py"
    if file.exists():
        raise PlumblineError(f"{file} is there already; nothing changed")
    file.parent.mkdir(exist_ok=True)
    file.write_text(TEMPLATE.replace("NAME", name), encoding="utf-8")
    yield f"{file}: a member of the catalogue already; change its equation, then `plumbline add {name}` or leave `models: auto` to judge it"
