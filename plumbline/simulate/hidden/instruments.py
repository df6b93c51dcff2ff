"""Hidden faults of the instruments: what is recorded, in terms of the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from plumbline.simulate.hidden._setup import Setup, beside_feet, moved, net_cop, on_each
from plumbline.simulate.jets import Array
from plumbline.simulate.records import Plate

SOFT = ("C7", "PELV", "RSHO", "LSHO", "RHIP", "LHIP")  # markers on the trunk and at the upper end of the thighs


def sync(setup: Setup, *, delay: float = 0.016) -> None:
    """The force record is late by `delay` [s]."""
    setup.force_late += delay


def offset(setup: Setup, *, b: float = 0.005, forward: float = 0.0) -> None:
    """Plates record a CoP too far right by b and too far forward by `forward` [m]."""
    setup.spoil_plates.append(on_each(lambda plate: moved(plate, b, forward)))


def drift(setup: Setup, *, c: float = 0.001) -> None:
    """The recorded CoP runs to the right by c [m/s] from the start of each record."""
    setup.spoil_plates.append(on_each(lambda plate: moved(plate, c * plate.time)))


def gain(setup: Setup, *, q: float = 0.04) -> None:
    """The recorded net CoP is (1 + q) times the true one, counted from the middle between the feet; both plates shift alike."""

    def spoil(plates: list[Plate]) -> list[Plate]:
        x, y = net_cop(plates)
        return [moved(plate, q * x, q * y) for plate in plates]

    setup.spoil_plates.append(spoil)


def crosstalk(setup: Setup, *, height: float = 0.04) -> None:
    """The contact surface lies `height` [m] above the plane in which the CoP is worked out: p - height Fx / Fz is recorded."""

    def spoil(plate: Plate) -> Plate:
        fx, fy, _ = plate.force.T
        moment = plate.moment + np.stack([-height * fy, height * fx, 0 * fx], axis=1)
        return replace(plate, moment=moment)

    setup.spoil_plates.append(on_each(spoil))


def force_scale(setup: Setup, *, s: float = 0.03) -> None:
    """All channels of both plates read 1 + s times the truth; the CoP stays."""
    setup.spoil_plates.append(on_each(lambda p: replace(p, force=(1 + s) * p.force, moment=(1 + s) * p.moment)))


def shear_scale(setup: Setup, *, s: float = 0.05) -> None:
    """The horizontal forces of both plates read 1 + s times the truth."""
    setup.spoil_plates.append(on_each(lambda p: replace(p, force=p.force * np.array([1 + s, 1 + s, 1.0]))))


def tilt(setup: Setup, *, a: float = 0.005) -> None:
    """Floor, plates and cameras are tilted by a [rad] against gravity: everything recorded is turned, x - a z for small a."""
    turn = np.array([[np.cos(a), 0.0, -np.sin(a)], [0.0, 1.0, 0.0], [np.sin(a), 0.0, np.cos(a)]])

    def spoil(plate: Plate) -> Plate:
        about_origin = (plate.moment + np.cross(plate.centre, plate.force)) @ turn.T
        force = plate.force @ turn.T
        return replace(plate, force=force, moment=about_origin - np.cross(plate.centre, force))

    setup.spoil_plates.append(on_each(spoil))
    setup.spoil_markers.append(lambda time, markers: {label: place @ turn.T for label, place in markers.items()})


def filter(setup: Setup, *, cutoff: float = 8.0) -> None:
    """The force record went through a causal second-order Butterworth low-pass, cut-off [Hz], in all channels."""

    from scipy.signal import butter, sosfilt, sosfilt_zi  # here, as it is slow to import and the demo needs none of it

    def spoil(plate: Plate) -> Plate:
        sos = butter(2, cutoff, fs=1 / (plate.time[1] - plate.time[0]), output="sos")
        wrench = np.concatenate([plate.force, plate.moment], axis=1)
        wrench, _ = sosfilt(sos, wrench, axis=0, zi=sosfilt_zi(sos)[:, :, None] * wrench[0])
        return replace(plate, force=wrench[:, :3], moment=wrench[:, 3:])

    setup.spoil_plates.append(on_each(spoil))


def com_bias(setup: Setup, *, scale: float = 0.0, e0: float = 0.0, pose: float = 0.0) -> None:
    """The lateral places of all markers but the feet's are (1 + scale) x + e0 + pose x_hips^2 [1, m, 1/m]; the laboratory stays."""

    def spoil(time: Array, markers: dict[str, Array]) -> dict[str, Array]:
        shift = e0 + pose * markers["PELV"][:, 0] ** 2
        return beside_feet(markers, {label: v + np.outer(scale * v[:, 0] + shift, (1, 0, 0)) for label, v in markers.items()})

    setup.spoil_markers.append(spoil)


def soft_tissue(setup: Setup, *, frequency: float = 5.0, damping: float = 0.2) -> None:
    r"""Markers of trunk and thighs ride on soft tissue: :math:`n'' + 2 s W n' + W^2 n = -x''`, W / 2 pi [Hz], s [1], lateral."""
    from scipy.signal import bilinear, lfilter, lfilter_zi  # here, see `filter`

    w = 2 * np.pi * frequency

    def spoil(time: Array, markers: dict[str, Array]) -> dict[str, Array]:
        # x + n follows x like a damped oscillator its foot
        b, a = bilinear([2 * damping * w, w**2], [1.0, 2 * damping * w, w**2], fs=(len(time) - 1) / (time[-1] - time[0]))
        out = dict(markers)
        for label in SOFT:
            x = markers[label][:, 0]
            y, _ = lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])
            out[label] = np.concatenate([y[:, None], markers[label][:, 1:]], axis=1)
        return out

    setup.spoil_markers.append(spoil)
