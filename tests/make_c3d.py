"""A small writer of C3D files for tests, in plain struct: every count, unit and sign can be made to lie."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

BLOCK = 512
PLATE = {  # a plate of 0.4 x 0.6 m, x and y as the lab's but z down: corners of the quadrants ++, -+, --, +- of the plate
    "CORNERS": np.array([[200.0, -300, 0], [-200, -300, 0], [-200, 300, 0], [200, 300, 0]]).T[:, :, None],
    "ORIGIN": np.array([[0.0], [0], [-40]]),
    "USED": 1,
}


def _parameter(name: str, group: int, value: Any) -> bytes:
    """One entry: name, group, link to the next, type, dimensions (first fastest), data."""
    if isinstance(value, str):
        value = [value]
    if isinstance(value, list) and value and isinstance(value[0], str):
        width = max(map(len, value)) or 1
        kind, shape, data = -1, [width, len(value)], "".join(v.ljust(width) for v in value).encode()
    else:
        array = np.asarray(value)
        kind, code = (2, "<i2") if array.dtype.kind in "iu" else (4, "<f4")
        shape, data = list(array.shape), array.astype(code).tobytes(order="F")
    body = struct.pack("<bB", kind, len(shape)) + bytes(shape) + data + b"\0"
    return struct.pack("<bb", len(name), group) + name.encode() + struct.pack("<h", len(body) + 2) + body


def _section(groups: dict[str, dict[str, Any]], processor: int) -> bytes:
    entries = b""
    for number, (group, parameters) in enumerate(groups.items(), 1):
        entries += struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<h", 3) + b"\0"
        entries += b"".join(_parameter(name, number, value) for name, value in parameters.items())
    blocks = -(-(len(entries) + 6) // BLOCK)
    return (bytes([1, 0x50, blocks, processor]) + entries).ljust(blocks * BLOCK, b"\0")


def write_c3d(
    path: Path,
    points: np.ndarray,
    analogs: np.ndarray | None = None,
    rate: float = 100.0,
    first: int = 1,
    residual: np.ndarray | None = None,
    header: dict[int, int] | None = None,
    processor: int = 84,
    **groups: dict[str, Any],
) -> Path:
    """Write points (n, m, 3) and analog counts (n * per_frame, channels) as float32; returns `path`.

    groups: parameters that replace or add to those written.  header: 16-bit words to overwrite, by index.
    """
    n, m = points.shape[:2]
    counts = np.empty((n, 0)) if analogs is None else np.asarray(analogs, float)
    per_frame, channels = (len(counts) // n, counts.shape[1]) if counts.size else (0, 0)
    words = np.zeros((n, m, 4))
    words[..., :3] = points
    words[..., 3] = 0 if residual is None else residual
    data = np.concatenate([words.reshape(n, -1), counts.reshape(n, -1)], axis=1).astype("<f4").tobytes()
    common: dict[str, dict[str, Any]] = {
        "POINT": {"USED": m, "SCALE": -1.0, "RATE": rate, "UNITS": "mm", "LABELS": [f"M{i}" for i in range(m)] or [""]},
        "ANALOG": {"USED": channels, "RATE": rate * per_frame, "GEN_SCALE": 1.0, "SCALE": np.ones(channels)},
    }
    common["ANALOG"] |= {"OFFSET": np.zeros(channels, int), "LABELS": [f"A{i}" for i in range(channels)] or [""]}
    if "FORCE_PLATFORM" in groups:
        groups["FORCE_PLATFORM"] = {**PLATE, "ZERO": np.array([0, 0]), **groups["FORCE_PLATFORM"]}
    merged = {name: {**common.get(name, {}), **groups.get(name, {})} for name in {**common, **groups}}
    merged["POINT"] = {"DATA_START": 0, **merged["POINT"]}
    start = 2 + len(_section(merged, processor)) // BLOCK
    merged["POINT"]["DATA_START"] = start
    head = bytearray(BLOCK)
    struct.pack_into("<BBHHHHHfHHf", head, 0, 2, 0x50, m, channels * per_frame, first, first + n - 1, 0, -1.0, start, per_frame, rate)
    for index, value in (header or {}).items():
        struct.pack_into("<H", head, 2 * index, value)
    path.write_bytes(bytes(head) + _section(merged, processor) + data)
    return path
