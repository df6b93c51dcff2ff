"""Hidden effects: what a study has and the plain model lacks. Each is one function that changes the set-up of a simulation.

`body`: motions and forces the plain model lacks.  `instruments`: faults of markers and plates.  `laws`: what the controller does.
`outside`: things that stand in no catalogue. A new effect is a new public function in one of these; it may change the habits, the
controller, add contacts or spoil the records. Names, units and signs are those of the project's catalogue of effects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

from plumbline.simulate.hidden import body, instruments, laws, outside
from plumbline.simulate.hidden._setup import Setup

__all__ = ["CONTROL", "EFFECTS", "OUTSIDE", "Setup", "apply"]


def _effects(module: ModuleType) -> dict[str, Callable[..., None]]:
    """The public functions that a module defines itself."""
    own = {name: value for name, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
    return {name: value for name, value in own.items() if callable(value) and not name.startswith("_") and not isinstance(value, type)}


EFFECTS: dict[str, Callable[..., None]] = {k: f for m in (body, instruments, laws, outside) for k, f in _effects(m).items()}
CONTROL = frozenset(_effects(laws)) | outside.CONTROL  # effects that the law alone has
OUTSIDE = frozenset(_effects(outside))  # effects that stand in no catalogue


def apply(setup: Setup, effects: Mapping[str, Mapping[str, Any]]) -> None:
    """Apply effects by name with their sizes; raises ValueError for an unknown name."""
    for name, sizes in effects.items():
        if name not in EFFECTS:
            raise ValueError(f"no hidden effect is called {name!r}; there are {', '.join(EFFECTS)}")
        EFFECTS[name](setup, **sizes)
