"""Write a simulated trial as a C3D file, as a laboratory would: markers in mm, two plates of type 2 in N and N mm."""

from __future__ import annotations

from pathlib import Path

import ezc3d
import numpy as np

from plumbline.simulate.records import Plate

#: from the reaction in lab axes to what a plate with axes right, back, down says of the action on it
_TO_PLATE = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
_CHANNELS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


def write(path: str | Path, markers: dict[str, np.ndarray], plates: list[Plate], rate: float, force_rate: float) -> None:
    """Write markers [m], label -> (n, 3), and plates with n force_rate / rate samples; rates [Hz].

    Raises ValueError where the format cannot hold them: every frame has the same whole number of samples.
    """
    frames = len(next(iter(markers.values())))
    ratio = round(force_rate / rate)
    if ratio * rate != force_rate or any(len(plate.time) != frames * ratio for plate in plates):
        raise ValueError(
            f"{[len(p.time) for p in plates]} samples at {force_rate} Hz do not make a whole number in each of {frames} frames "
            f"at {rate} Hz; choose a rate of the plates that is a multiple of the markers'"
        )
    c = ezc3d.c3d()
    places = np.stack(list(markers.values()), axis=1) * 1e3
    points = np.ones((4, places.shape[1], frames))
    points[:3] = places.transpose(2, 1, 0)
    c["parameters"]["POINT"]["RATE"]["value"] = [rate]
    c["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    c["parameters"]["POINT"]["LABELS"]["value"] = list(markers)
    c["data"]["points"] = points
    c["data"]["meta_points"]["residuals"] = np.zeros((1, places.shape[1], frames))
    _analog(c, plates, force_rate)
    _platform(c, plates)
    c.write(str(path))


def _analog(c: ezc3d.c3d, plates: list[Plate], rate: float) -> None:
    """Six channels per plate."""
    rows = [(np.concatenate([p.force, p.moment * 1e3], axis=1) * _TO_PLATE).T for p in plates]
    analog = c["parameters"]["ANALOG"]
    analog["RATE"]["value"] = [rate]
    analog["LABELS"]["value"] = [f"{name}{i + 1}" for i in range(len(plates)) for name in _CHANNELS]
    analog["UNITS"]["value"] = ["N", "N", "N", "Nmm", "Nmm", "Nmm"] * len(plates)
    c["data"]["analogs"] = np.concatenate(rows)[None]


def _platform(c: ezc3d.c3d, plates: list[Plate]) -> None:
    """Corners, origin and channels, on the group that a new file has already (adding would turn integers to floats)."""
    n = len(plates)
    group = c["parameters"]["FORCE_PLATFORM"]
    group["USED"]["value"] = [n]
    group["TYPE"]["value"] = [2] * n
    group["ZERO"]["value"] = [1, 0]
    group["CORNERS"]["value"] = np.stack([plate.corners.T * 1e3 for plate in plates], axis=2)
    group["ORIGIN"]["value"] = np.zeros((3, n))
    group["CHANNEL"]["value"] = (np.arange(6)[:, None] + 1 + 6 * np.arange(n)).astype(int)
