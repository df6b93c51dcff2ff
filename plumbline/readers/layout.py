"""What the bytes of a C3D file hold, told from the header and the file's length (C3D file format user guide, c3d.org).

The counts in a C3D are written twice, in the header and in the parameter section, and either may lie. The file's
length cannot: of the two layouts the one that fills the file is right.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbline.errors import Refused

Array = NDArray[np.float64]
BLOCK = 512  # [bytes]
INTEL, DEC, MIPS = 84, 85, 86


@dataclass(frozen=True)
class Header:
    """The first block.  points, analogs: values per frame.  per_frame: analog samples per frame.  first: first frame,
    counted from 1.  frames: last - first + 1.  start: byte at which the data begin.  scale: mm per count, < 0 for floats.
    rate: [Hz].  parameters: byte at which the parameter section begins.  size: of the file [bytes].
    """

    points: int
    analogs: int
    per_frame: int
    first: int
    frames: int
    start: int
    scale: float
    rate: float
    processor: int
    parameters: int
    size: int


class Layout(NamedTuple):
    """Numbers per frame: points (4 words each), analog channels, analog samples of each channel; and the frames read."""

    points: int
    channels: int
    per_frame: int
    frames: int = 0

    @property
    def words(self) -> int:
        """Words in one frame."""
        return 4 * self.points + self.channels * self.per_frame


def header(path: Path) -> Header:
    """Read the first block of a C3D and check that it can be one.

    Raises Refused (empty_file, unreadable, unsupported, truncated).
    """
    size = path.stat().st_size
    if size == 0:
        raise Refused("empty_file", f"{path.name} holds no bytes", "export the recording again")
    with path.open("rb") as file:
        block = file.read(BLOCK)
        if len(block) < BLOCK or block[1] != 0x50:
            raise Refused("unreadable", f"{path.name} is no C3D: its second byte is not 0x50", "check what the file is")
        parameters = (block[0] - 1) * BLOCK
        file.seek(max(parameters, 0))
        processor = (file.read(4) + bytes(4))[3]
    _check_processor(path.name, processor, parameters, size)
    word, real = np.frombuffer(block, "<u2"), _reals(np.frombuffer(block, "<u2"), processor == DEC)
    start = (int(word[8]) - 1) * BLOCK
    if word[8] and start >= size:
        message = f"{path.name} ends before its data: the header puts them at byte {start}, the file has {size}"
        raise Refused("truncated", message, "copy or export the file again")
    frames = (int(word[4]) - int(word[3])) % 65536 + 1
    counts = (int(word[1]), int(word[2]), int(word[9]), int(word[3]), frames, start)
    return Header(*counts, float(real[3]), float(real[5]), processor, parameters, size)


def _check_processor(name: str, processor: int, parameters: int, size: int) -> None:
    if parameters < BLOCK or parameters + 4 > size:
        message = f"{name}: the header puts the parameter section at byte {parameters}, the file has {size}"
        raise Refused("unreadable", message, "export the recording again")
    if processor == MIPS:
        message = f"{name} is in the byte order of MIPS (SGI) machines"
        raise Refused("unsupported", message, "re-export it as PC (Intel)")
    if processor not in (INTEL, DEC):
        message = f"{name} names no known processor (code {processor} at byte {parameters + 3})"
        raise Refused("unreadable", message, "the parameter section is damaged or absent; export the recording again")


def _reals(words: NDArray[np.uint16], vax: bool) -> Array:
    """Pairs of 16-bit words as single reals; DEC reals have the words swapped and the exponent two higher."""
    pairs = words[: len(words) // 2 * 2].reshape(-1, 2)
    if vax:
        pairs = pairs[:, ::-1]
    with np.errstate(all="ignore"):  # bytes that are no number at all
        return np.ascontiguousarray(pairs).view("<f4").ravel().astype(float) / (4.0 if vax else 1.0)


def choose(head: Header, stated: Layout, counts: list[int]) -> Layout | None:
    """The layout that fills the file: `stated` by the parameters, else the header's; None where neither does.

    counts: the frame counts that header and parameters name.  The result carries the number of frames: the largest
    count that the file holds, provided that no full block is left over or no larger count was named.
    """
    channels = head.analogs // head.per_frame if head.per_frame else 0
    layouts = [stated, Layout(head.points, channels, head.per_frame)]
    fits = [(layout._replace(frames=frames), snug) for layout in layouts for frames, snug in [_fit(head, layout, counts)]]
    for want_snug in (True, False):
        for layout, snug in fits:
            if layout.frames and (snug or (not want_snug and layout.frames == max(counts))):
                return layout
    return None


def present(head: Header, layout: Layout) -> int:
    """Whole frames between the start of the data and the end of the file."""
    return (head.size - head.start) // _frame_bytes(head, layout) if layout.words else 0


def _frame_bytes(head: Header, layout: Layout) -> int:
    return layout.words * (4 if head.scale < 0 else 2)


def _fit(head: Header, layout: Layout, counts: list[int]) -> tuple[int, bool]:
    """Largest of the counts that the file holds, and whether less than a block (and a frame) is left over."""
    frames = max((n for n in counts if 0 < n <= present(head, layout)), default=0)
    spare = head.size - head.start - frames * _frame_bytes(head, layout)
    return frames, frames > 0 and spare < BLOCK + _frame_bytes(head, layout)


def decode(path: Path, head: Header, layout: Layout) -> tuple[Array, Array]:
    """The data section as it stands: points with their fourth word (n, m, 4) in stored counts, analog (samples, channels)."""
    with path.open("rb") as file:
        file.seek(head.start)
        data = file.read(layout.frames * _frame_bytes(head, layout))
    real = head.scale < 0
    values = _reals(np.frombuffer(data, "<u2"), head.processor == DEC) if real else np.frombuffer(data, "<i2").astype(float)
    values = values.reshape(layout.frames, layout.words)
    points = values[:, : 4 * layout.points].reshape(layout.frames, layout.points, 4)
    return points, values[:, 4 * layout.points :].reshape(layout.frames * layout.per_frame, layout.channels)


class Parameters:
    """The parameter section as ezc3d hands it over; absent parameters read as empty."""

    def __init__(self, raw: Any) -> None:
        self._raw = raw

    def array(self, group: str, name: str) -> NDArray[Any]:
        """One parameter with its dimensions, as stored."""
        entry = self._raw[group][name] if group in self._raw and name in self._raw[group] else {"value": []}
        return np.asarray(entry["value"])

    def values(self, group: str, name: str) -> list[Any]:
        """All values of a parameter, continued over NAME2, NAME3, ... where there are more than 255."""
        values: list[Any] = []
        for suffix in ("", *range(2, 100)):
            part = self.array(group, f"{name}{suffix}").ravel().tolist()
            if not part and suffix:
                break
            values += part
        return values

    def text(self, group: str, name: str) -> list[str]:
        """The values as text without padding."""
        return [str(value).strip(" \0") for value in self.values(group, name)]

    def number(self, group: str, name: str, default: float = 0.0) -> float:
        """The first value as a number."""
        values = self.values(group, name)
        return float(values[0]) if values else default


def damage(path: Path, head: Header) -> str:
    """What is wrong in the chain of groups and parameters, in words; empty where it holds together."""
    with path.open("rb") as file:
        file.seek(head.parameters)
        data = file.read(255 * BLOCK)
    at, groups = 4, dict[int, str]()
    while at + 2 < len(data):
        length, number = (int(n) for n in np.frombuffer(data, "i1", 2, at))
        if length == 0:
            return ""
        name = data[at + 2 : at + 2 + abs(length)].decode("latin-1")
        link = at + 2 + abs(length)
        if not name.isprintable() or link + 5 > len(data):
            return f"at byte {head.parameters + at} stands no name"
        step = int(np.frombuffer(data, "<i2", 1, link)[0])
        if number < 0:
            groups[-number] = name
        fault = _parameter_fault(data, link, step) if number > 0 else ""
        if step < 0 or fault:
            return f"{groups.get(number, number)}:{name} {fault or 'points backwards'}"
        if step == 0:
            return ""
        at = link + step
    return "the chain of parameters leaves the section"


def _parameter_fault(data: bytes, link: int, step: int) -> str:
    """What is wrong with the parameter whose link to the next entry stands at byte `link`."""
    kind, dimensions = int(np.frombuffer(data, "i1", 1, link + 2)[0]), data[link + 3]
    if kind not in (-1, 1, 2, 4):
        return f"is of the unknown type {kind}"
    sizes = np.frombuffer(data[link + 4 : link + 4 + dimensions], "u1").astype(float)
    end = link + 4 + dimensions + abs(kind) * float(np.prod(sizes))
    return "runs over the next entry" if end > (link + step if step > 0 else len(data)) else ""
