"""Effects that stand in no catalogue: a search must say that something is left, and name nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from plumbline.simulate.contacts import Field
from plumbline.simulate.hidden._setup import Setup, beside_feet, moved, net_cop, on_each
from plumbline.simulate.jets import Array
from plumbline.simulate.records import Plate

CONTROL = frozenset({"rhythm", "lopsided", "softening"})  # those that the law alone has


def wall(setup: Setup, *, k: float = 30000.0, x: float = 0.02, height: float = 1.1) -> None:
    """A soft wall on the right: force -k max(0, CoM - x)^2 [N/m2] at a height [m]."""
    setup.contacts.append(Field(lambda time, com, v: -k * np.maximum(com - x, 0.0) ** 2, height))


def cubic(setup: Setup, *, k: float = 60000.0, height: float = 1.1) -> None:
    """A spring that hardens: force -k x^3 [N/m3] at a height [m]."""
    setup.contacts.append(Field(lambda time, com, v: -k * com**3, height))


def hand_damper(setup: Setup, *, c: float = 60.0, height: float = 1.1) -> None:
    """An unmeasured hold that only damps: force -c x' [N s/m] at a height [m]."""
    setup.contacts.append(Field(lambda time, com, v: -c * v, height))


def periodic(setup: Setup, *, size: float = 10.0, frequency: float = 0.7, height: float = 1.1) -> None:
    """A lateral force of unknown source, size [N], frequency [Hz], its phase another in each trial."""
    phase, w = setup.phases(), 2 * np.pi * frequency
    setup.contacts.append(Field(lambda time, com, v: size * np.sin(w * time + phase) + 0 * com, height))


def friction(setup: Setup, *, size: float = 10.0, speed: float = 0.02, height: float = 1.1) -> None:
    """Something rubs: force -size tanh(x' / speed) [N, m/s] at a height [m]."""
    setup.contacts.append(Field(lambda time, com, v: -size * np.tanh(v / speed), height))


def magnet(setup: Setup, *, size: float = 12.0, x: float = 0.06, reach: float = 0.02, height: float = 1.1) -> None:
    """A place that draws the body: force -size s exp((1 - s^2) / 2) with s = (CoM - x) / reach [N, m, m] at a height [m]."""

    def law(time: Array, com: Array, v: Array) -> Array:
        s = (com - x) / reach
        return np.asarray(-size * s * np.exp((1 - s**2) / 2))

    setup.contacts.append(Field(law, height))


def bent_cop(setup: Setup, *, cubed: float = 3.0) -> None:
    """The recorded net CoP is p + cubed p^3 [1/m2]."""
    _net(setup, lambda p: cubed * p**3)


def hinged_cop(setup: Setup, *, slope: float = 0.2, edge: float = 0.06) -> None:
    """The recorded net CoP runs too far beyond an edge [m] on both sides, by slope (abs(p) - edge)."""
    _net(setup, lambda p: slope * np.sign(p) * np.maximum(np.abs(p) - edge, 0.0))


def _net(setup: Setup, shift: Callable[[Array], Array]) -> None:
    """Both plates' CoP shifted by a function of the net one."""

    def spoil(plates: list[Plate]) -> list[Plate]:
        x, _ = net_cop(plates)
        return [moved(plate, shift(x)) for plate in plates]

    setup.spoil_plates.append(spoil)


def creep(setup: Setup, *, share: float = 0.15, time: float = 1.5) -> None:
    """The plates' vertical channels and moments creep: a share [1] of them is added after a first-order lag [s]."""

    from scipy.signal import lfilter  # here, as it is slow to import and the demo needs none of it

    def spoil(plate: Plate) -> Plate:
        keep = np.exp(-(plate.time[1] - plate.time[0]) / time)

        def slow(y: Array) -> Array:
            return np.asarray(lfilter([1 - keep], [1, -keep], y, axis=0, zi=keep * y[:1])[0])

        force = plate.force.copy()
        force[:, 2] += share * (slow(force[:, 2:])[:, 0] - force[:, 2].mean())
        return replace(plate, force=force, moment=plate.moment + share * (slow(plate.moment) - plate.moment.mean(axis=0)))

    setup.spoil_plates.append(on_each(spoil))


def lens(setup: Setup, *, cubed: float = 4.0) -> None:
    """The cameras' picture is warped: lateral places of all markers but the feet's are x + cubed h^3 [1/m2], h that of the hips."""

    def spoil(time: Array, markers: dict[str, Array]) -> dict[str, Array]:
        warp = np.zeros_like(markers["PELV"])
        warp[:, 0] = cubed * markers["PELV"][:, 0] ** 3
        return beside_feet(markers, {label: place + warp for label, place in markers.items()})

    setup.spoil_markers.append(spoil)


def rhythm(setup: Setup, *, size: float = 0.01, frequency: float = 0.4) -> None:
    """The reference sways, size [m], frequency [Hz], alike in all trials."""
    setup.quirk(sway=size, sway_rate=frequency)


def lopsided(setup: Setup, *, share: float = 0.4) -> None:
    """k1 is larger on the right by a share [1]."""
    setup.quirk(lopsided=share)


def softening(setup: Setup, *, bend: float = 0.12) -> None:
    """The law weakens far out: k1 e (1 - (e / bend)^2) [m]."""
    setup.quirk(bend=bend)
