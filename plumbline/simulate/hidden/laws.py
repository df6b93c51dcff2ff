"""Hidden parts of the controller."""

from __future__ import annotations

from dataclasses import replace

from plumbline.simulate.hidden._setup import Setup


def delay(setup: Setup, *, delay: float = 0.08) -> None:
    """The law acts on the state `delay` ago [s]."""
    setup.controller = replace(setup.controller, delay=setup.controller.delay + delay)


def lag(setup: Setup, *, time: float = 0.08, clip_last: bool = False) -> None:
    """The ZMP follows the wanted one with a first-order lag [s]; clip_last: the limits act after it."""
    setup.controller = replace(setup.controller, lag=time, clip_last=clip_last)


def intermittent(setup: Setup, *, half_width: float = 0.01, zone: str = "soft") -> None:
    """Within half_width [m] of the reference the law does not see the place ("soft", "jump") or holds its output ("hold")."""
    setup.quirk(dead=half_width, zone=zone)


def ref_drift(setup: Setup, *, rate: float = 0.002) -> None:
    """The reference runs to the right by `rate` [m/s] from the start of each record."""
    setup.quirk(drift=rate)


def intrinsic(setup: Setup, *, kappa: float = 0.6, beta: float = 0.15) -> None:
    """Ankles and hips are springs and dampers too: kappa (x - d) + beta x' [1, s] without delay."""
    setup.quirk(kappa=kappa, beta=beta)


def integral(setup: Setup, *, ki: float = 0.5) -> None:
    """The law adds ki times the integral of x - d [1/s]."""
    setup.quirk(integral=ki)


def sensory(setup: Setup, *, sd: float = 0.004, time: float = 0.1) -> None:
    """The law sees the CoM with noise of this size [m] and correlation time [s], and its velocity with the noise's."""
    setup.quirk(sensed=sd, sensed_time=time)


def limits(setup: Setup, *, knee: float = 0.01) -> None:
    """The limits of the ZMP are rounded over a width [m]."""
    setup.quirk(knee=knee)
