"""C3D files through ezc3d: markers, the lab's own derived points and force plates, in SI and the lab's axes.

What ezc3d leaves open is settled here: the true layout of the frames (:mod:`plumbline.readers.layout`), missing samples and
signs of offsets. Labels, units and what is a marker: :mod:`plumbline.readers.points`; plates: :mod:`plumbline.readers.plates`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

from plumbline.errors import Refused
from plumbline.readers.layout import BLOCK, Array, Header, Layout, Parameters, choose, damage, decode, header, present
from plumbline.readers.plates import Channels, read_plates
from plumbline.readers.points import length_unit, sort_points
from plumbline.readers.raw import Raw, RawPlate


@dataclass
class _Samples:
    """Samples as the file states them.  points: stated length unit, missing as NaN, shape (n, m, 3).  analogs: scaled,
    shape (k, channels).  rate: of the frames [Hz].  start: time of the first frame [s].
    """

    points: Array
    analogs: Array
    rate: float
    start: float
    per_frame: int


def read(path: Path) -> Raw:
    """Read one C3D: lengths in m, forces in N, moments in N m, time from the file's own first frame.

    Raises Refused (empty_file, unreadable, unsupported, truncated, too_large, no_rate, no_unit, no_data).
    """
    head = header(path)
    file = _open(path, head)
    parameters, notes = Parameters(file["parameters"]), list[str]()
    samples = _samples(path, head, file, parameters, notes)
    points = sort_points(samples.points, parameters, notes)
    plates = list[RawPlate]()
    if points.markers or points.derived or parameters.number("FORCE_PLATFORM", "USED"):
        length = length_unit(path.name, points.markers, parameters, notes)
        plates = read_plates(parameters, _channels(samples, parameters), length, notes)
    if not points.markers and not points.derived and not plates:
        message = f"{path.name} holds neither a valid marker nor a force plate ({'; '.join(notes) or 'no points'})"
        raise Refused("no_data", message, "check what was exported")
    frames = len(samples.points)
    return Raw(
        time=samples.start + np.arange(frames) / samples.rate,
        rate=samples.rate,
        points=np.stack([*points.markers.values()], axis=1) * length if points.markers else np.empty((frames, 0, 3)),
        labels=list(points.markers),
        derived={label: values * length for label, values in points.derived.items()},
        plates=plates,
        notes=notes,
    )


def _open(path: Path, head: Header) -> Any:
    """The file through ezc3d; its errors, and memory that a damaged count asks for, become Refused with the cause."""
    try:
        return ezc3d.c3d(str(path))
    except (OSError, RuntimeError, ValueError, IndexError, KeyError, MemoryError) as error:
        fault = damage(path, head)
        if fault:
            raise Refused("unreadable", f"{path.name}: the parameter section is damaged: {fault}", "export it again") from error
        if isinstance(error, MemoryError) or "bad_alloc" in str(error):
            raise Refused("too_large", f"{path.name} takes more memory than allowed", "cut the recording") from error
        words = str(error).split(" If you want")[0].removesuffix(": iostream error")
        raise Refused("unreadable", f"{path.name}: ezc3d says: {words}", "export the recording again") from error


def _samples(path: Path, head: Header, file: Any, parameters: Parameters, notes: list[str]) -> _Samples:
    """Points and analog channels in the layout that fills the file; notes tell where header and parameters disagree."""
    points, analogs = file["data"]["points"], file["data"]["analogs"][0]
    per_frame = round(analogs.shape[1] / points.shape[2]) if points.shape[2] else 0
    stated = Layout(points.shape[1], analogs.shape[0], per_frame)
    counts = _frame_counts(head, parameters)
    layout = choose(head, stated, counts)
    if layout is None:
        raise _no_layout(path.name, head, stated, max(counts))
    rate = parameters.number("POINT", "RATE") or head.rate
    if not (np.isfinite(rate) and rate > 0):
        raise Refused("no_rate", f"{path.name} states no rate of its frames", "state POINT:RATE when exporting")
    if layout[:3] == stated[:3]:
        xyz, volts = (
            points[:3].transpose(2, 1, 0)[: layout.frames].copy(),
            analogs.T[: layout.frames * per_frame].copy(),
        )
        volts += _offset_repair(parameters, layout.channels)
    else:
        notes.append(f"header and parameters disagree: {_words(stated)} against {_words(layout)}; the second fills the file")
        xyz, volts = _decoded(path, head, layout, parameters)
    xyz[(xyz == 0).all(axis=2)] = np.nan
    notes += _oddities(head, parameters, layout, counts, rate)
    return _Samples(xyz, volts, rate, (head.first - 1) / rate if head.first else 0.0, layout.per_frame)


def _oddities(head: Header, parameters: Parameters, layout: Layout, counts: list[int], rate: float) -> list[str]:
    """Where rates, counts and the file's length contradict each other, in words."""
    notes, stated, held = [], parameters.number("ANALOG", "RATE"), rate * layout.per_frame
    if layout.channels and stated and abs(stated - held) > 1e-3 * stated:
        notes.append(f"ANALOG:RATE says {stated:g} Hz, the frames hold {held:g} Hz, which is used")
    if len(set(counts)) > 1:
        notes.append(f"frame counts disagree ({', '.join(map(str, counts))}): {layout.frames} read")
    more = present(head, layout) - layout.frames
    if more > 1 and more * layout.words * 2 > BLOCK:
        notes.append(f"{more} frames could follow the {layout.frames} that the header states; they are not read")
    return notes


def _no_layout(name: str, head: Header, stated: Layout, frames: int) -> Refused:
    """Why no layout fills the file."""
    if stated.words == 0 and head.points == 0 and head.analogs == 0:
        return Refused("no_data", f"{name} holds neither points nor analog channels", "check what was exported")
    held = present(head, stated)
    if frames == 65536 and held == 0:  # last frame stated as first - 1
        return Refused("empty_file", f"{name} holds no frames", "check what was exported")
    message = f"{name} ends early: its header states {frames} frames, the file holds {held}"
    return Refused("truncated", message, "copy or export the file again")


def _words(layout: Layout) -> str:
    return f"{layout.points} points and {layout.channels} channels of {layout.per_frame} samples a frame"


def _frame_counts(head: Header, parameters: Parameters) -> list[int]:
    """Numbers of frames by the header and, for long files, by the parameters (ezc3d overwrites POINT:FRAMES)."""
    counts = [head.frames, int(parameters.number("POINT", "LONG_FRAMES"))]
    ends = [parameters.values("TRIAL", f"ACTUAL_{end}_FIELD") for end in ("START", "END")]
    if all(len(end) == 2 for end in ends):
        first, last = (int(low) % 65536 + 65536 * (int(high) % 65536) for low, high in ends)
        counts.append(last - first + 1)
    return [count for count in counts if count > 0]


def _decoded(path: Path, head: Header, layout: Layout, parameters: Parameters) -> tuple[Array, Array]:
    """Points and analog values decoded here, for a layout that ezc3d does not believe in."""
    words, volts = decode(path, head, layout)
    xyz = words[:, :, :3] * (head.scale if head.scale > 0 else 1.0)
    xyz[words[:, :, 3] < 0] = np.nan
    scale, offset = _scale(parameters, layout.channels), _offsets(parameters, layout.channels)
    return xyz, (volts - offset) * scale


def _scale(parameters: Parameters, channels: int) -> Array:
    """Physical unit per count of each channel: ANALOG:SCALE times GEN_SCALE, 1 where not stated."""
    stated = [float(s) for s in parameters.values("ANALOG", "SCALE")][:channels]
    return np.array(stated + [1.0] * (channels - len(stated))) * parameters.number("ANALOG", "GEN_SCALE", 1.0)


def _offsets(parameters: Parameters, channels: int) -> Array:
    """Counts at zero load; 16-bit integers, without sign where ANALOG:FORMAT says UNSIGNED."""
    stated = [float(s) for s in parameters.values("ANALOG", "OFFSET")][:channels]
    offsets = np.array(stated + [0.0] * (channels - len(stated)))
    unsigned = [text.upper() for text in parameters.text("ANALOG", "FORMAT")][:1] == ["UNSIGNED"]
    return np.where(unsigned & (offsets < 0), offsets + 65536, offsets)


def _offset_repair(parameters: Parameters, channels: int) -> Array:
    """ezc3d 1.7.2 subtracts |OFFSET|; what must be added where OFFSET is negative."""
    stated = np.array([float(s) for s in parameters.values("ANALOG", "OFFSET")][:channels] + [0.0] * channels)[:channels]
    wrong: Array = np.abs(stated) - _offsets(parameters, channels)
    return wrong * _scale(parameters, channels)


def _channels(samples: _Samples, parameters: Parameters) -> Channels:
    time = samples.start + np.arange(len(samples.analogs)) / (samples.rate * max(samples.per_frame, 1))
    labels, units = parameters.text("ANALOG", "LABELS"), parameters.text("ANALOG", "UNITS")
    return Channels(samples.analogs, labels, units, time, samples.per_frame)
