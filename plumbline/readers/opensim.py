"""OpenSim text files: TRC markers, MOT and STO ground forces.

TRC: a path line, a line of keys, a line of values, a line of labels, a line X1 Y1 Z1 ..., rows of frame, time, positions.
MOT and STO: a header up to `endheader`, a line of column names, rows. Forces are found by the names of their columns.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from plumbline.errors import Refused
from plumbline.readers import numbers
from plumbline.readers.raw import Array, Raw, RawPlate


def read(path: Path) -> Raw:
    """A TRC, MOT or STO file, by its ending."""
    return read_trc(path) if path.suffix.lower() == ".trc" else read_storage(path)


# -- TRC --------------------------------------------------------------------------------------------------------------


def read_trc(path: Path) -> Raw:
    """Markers of a TRC file [m] in the lab's axes.

    Counts in the header are not believed: what the rows hold counts, and a difference is noted.
    Raises Refused: empty_file, unreadable, truncated, no_unit, bad_time, no_rate, no_data.
    """
    lines, ended, notes = numbers.decode(path)
    head = _trc_header(lines, path.name)
    first, labels_line = _trc_body(lines, path.name)
    stated = _whole(head.get("numframes", ""))
    rows = [line for line in lines[first:] if line.strip()]
    data = numbers.matrix(numbers.frame(rows, "\t", ended, path.name, stated), path.name)
    if stated is not None and stated != len(data):
        notes.append(f"{path.name}: the header states {stated} frames, the file holds {len(data)}")
    labels = _trc_labels(labels_line, data[:, 2:], _whole(head.get("nummarkers", "")), path.name, notes)
    scale = numbers.factor(head.get("units", ""), "length", f"{path.name} (header field Units)")
    points = data[:, 2 : 2 + 3 * len(labels)].reshape(len(data), len(labels), 3) * scale
    rate = numbers.chosen_rate(_number(head.get("datarate", "")), data[:, 1], path.name, notes)
    return Raw(data[:, 1], rate, numbers.missing_as_nan(points), numbers.unique(labels, notes), notes=notes)


def _trc_header(lines: list[str], name: str) -> dict[str, str]:
    """Header values by lower-case key; tabs may be doubled between values, and lines may be padded with tabs."""
    at = next((i for i, line in enumerate(lines[:10]) if line.strip().lower().startswith("datarate")), None)
    if at is None or at + 1 >= len(lines):
        raise Refused(
            "unreadable",
            f"{name} has no TRC header (a line that starts with DataRate)",
            "export it as TRC, or correct its ending",
        )
    keys, values = lines[at].split("\t"), lines[at + 1].split("\t")
    full_keys, full_values = [k for k in keys if k.strip()], [v for v in values if v.strip()]
    pairs = zip(full_keys, full_values, strict=True) if len(full_keys) == len(full_values) else zip(keys, values, strict=False)
    return {k.strip().lower(): v.strip() for k, v in pairs}


def _trc_body(lines: list[str], name: str) -> tuple[int, str]:
    """Index of the first data row and the line of labels."""
    at = next((i for i, line in enumerate(lines[:12]) if line.strip().lower().startswith("frame")), None)
    if at is None:
        raise Refused("unreadable", f"{name} has no line of labels (it starts with Frame#)", "export it as TRC again")
    first = next((i for i in range(at + 1, len(lines)) if _number(lines[i].split("\t")[0]) is not None), None)
    if first is None:
        raise Refused("empty_file", f"{name} has a header but no frames", "export it again")
    return first, lines[at]


def _trc_labels(line: str, data: Array, stated: int | None, name: str, notes: list[str]) -> list[str]:
    """One label per three columns of data; blank ones are named by their place, labels without columns dropped with a note."""
    cells = [c.strip() for c in line.split("\t")[2:]]
    while cells and not cells[-1]:
        cells.pop()
    usual = all(not c for i, c in enumerate(cells) if i % 3)  # label, blank, blank: there a blank label keeps its place
    cells = cells[::3] if usual else [c for c in cells if c]
    room = data.shape[1] // 3
    while room > len(cells) and np.isnan(data[:, 3 * room - 3 : 3 * room]).all():
        room -= 1  # columns that only the padding of the rows made
    if not room:
        raise Refused("no_data", f"{name} holds no marker columns", "export it with its markers")
    if stated is not None and stated != len(cells):
        notes.append(f"{name}: the header states {stated} markers, the line of labels has {len(cells)}, the rows have room for {room}")
    if len(cells) > room:
        notes.append(f"{name}: labels without columns are left out: {', '.join(cells[room:])}")
    labels = [cells[i] if i < len(cells) else "" for i in range(room)]
    blank = [i + 1 for i, label in enumerate(labels) if not label]
    if blank:
        notes.append(f"{name}: markers without a label, named by their place: {blank}")
    return [label or f"unnamed{i + 1}" for i, label in enumerate(labels)]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _whole(text: str) -> int | None:
    value = _number(text)
    return int(value) if value is not None and np.isfinite(value) else None


# -- MOT and STO ------------------------------------------------------------------------------------------------------


@dataclass
class _Columns:
    """Columns of one plate: v force, p point, m moment; index of x, y, z in each."""

    key: str
    v: dict[str, int] = field(default_factory=dict)
    p: dict[str, int] = field(default_factory=dict)
    m: dict[str, int] = field(default_factory=dict)


def read_storage(path: Path) -> Raw:
    """Force plates of a MOT or STO file, as recorded, moments about a fixed point on each plate.

    Raises Refused: empty_file, unreadable, truncated, bad_time, no_rate, no_data (no force columns: joint angles, muscle states).
    """
    lines, ended, notes = numbers.decode(path)
    head, first = _storage_header(lines, path.name)
    sep = "\t" if "\t" in lines[first] else None
    names = [n for n in numbers.fields(lines[first], sep) if n]
    rows = [line for line in lines[first + 1 :] if line.strip()]
    stated = next((v for k in ("nrows", "datarows") if (v := _whole(head.get(k, ""))) is not None), None)
    data = numbers.matrix(numbers.frame(rows, sep, ended, path.name, stated), path.name)
    if stated is not None and stated != len(data):
        notes.append(f"{path.name}: the header states {stated} rows, the file holds {len(data)}")
    if data.shape[1] < len(names):
        raise Refused("unreadable", f"{path.name} names {len(names)} columns, its rows have {data.shape[1]}", "export it again")
    rate = numbers.chosen_rate(_number(head.get("datarate", "")), data[:, 0], path.name, notes)
    plates = [_plate(data, columns, notes, path.name) for columns in _force_columns(names, path.name)]
    return Raw(np.empty(0), rate, np.empty((0, 0, 3)), [], plates=[p for p in plates if p is not None], notes=notes)


def _storage_header(lines: list[str], name: str) -> tuple[dict[str, str], int]:
    """Header values by lower-case key, and the index of the line of column names."""
    end = next((i for i, line in enumerate(lines) if line.strip().lower().startswith("endheader")), None)
    start = 0 if end is None else end + 1
    first = next((i for i in range(start, len(lines)) if lines[i].strip().lower().startswith("time")), None)
    if first is None:
        raise Refused("unreadable", f"{name} has no line of column names that starts with time", "export it as MOT or STO again")
    pairs = (re.split(r"=|\s+", line.strip(), maxsplit=1) for line in lines[:start])
    return {p[0].strip().lower(): p[1].strip() for p in pairs if len(p) == 2}, first


_WORDS = re.compile(r"ground|force|torque|moment|plate|grf|_|\s|\.")
_TAILED = re.compile(r"^(?P<body>.*(?:force|torque|moment|grf|plate).*?)[_.](?P<kind>[vpm]?)(?P<axis>[xyz])$")
_SHORT = (
    re.compile(r"^(?P<kind>[fpm])(?P<body>\d+)_(?P<axis>[xyz123])$"),  # f1_1: OpenSim's own C3D export
    re.compile(r"^(?P<kind>[fm])(?P<axis>[xyz])(?P<body>\d+)$"),  # Fx1: channels of the plates
    re.compile(r"^(?P<kind>[fm])(?P<body>\d+)(?P<axis>[xyz])$"),  # F1X: as in ANC files
)


def _force_columns(names: list[str], file: str) -> list[_Columns]:
    """The columns of each plate, in the order of their names in the file.

    Known styles: ground_force_1_vx, 1_ground_force_vx, R_ground_force_vx, ground_force_vx, each with _px and ground_torque_x
    or _mx; f1_1 p1_1 m1_1; Fx1 Mx1; F1X M1X.
    """
    found: dict[str, _Columns] = {}
    for index, name in enumerate(names):
        part = _force_part(name.lower())
        if part:
            key, kind, axis = part
            getattr(found.setdefault(key, _Columns(key)), kind)[axis] = index
    whole = [c for c in found.values() if len(c.v) == 3 and (len(c.p) == 3 or len(c.m) == 3)]
    if not whole:
        raise Refused(
            "no_data",
            f"{file} holds no ground forces; its columns are {', '.join(names[:6])}, ...",
            "give the force file of the trial instead",
        )
    return whole


def _force_part(name: str) -> tuple[str, str, str] | None:
    """Plate key, kind (v, p, m) and axis (x, y, z) that a column name says, or None."""
    tailed = _TAILED.match(name)
    if tailed:
        body = tailed["body"]
        kind = tailed["kind"] or ("m" if re.search("torque|moment", body) else "v")
        return _WORDS.sub("", body), kind, tailed["axis"]
    for pattern in _SHORT:
        short = pattern.match(name)
        if short:
            return (
                short["body"],
                {"f": "v", "p": "p", "m": "m"}[short["kind"]],
                {"1": "x", "2": "y", "3": "z"}.get(short["axis"], short["axis"]),
            )
    return None


def _plate(data: Array, columns: _Columns, notes: list[str], file: str) -> RawPlate | None:
    """One plate, or None (with a note) where all its columns are zero."""
    said = f"{file}: plate '{columns.key or '1'}'"
    force = _take(data, columns.v)
    if not np.nan_to_num(force).any():
        notes.append(f"{said} holds zeros only and is left out")
        return None
    point, free = _take(data, columns.p), _take(data, columns.m)
    scale = _length_scale(force, point, free)
    if scale != 1.0:
        notes.append(f"{said}: points and moments look like mm and N mm; read so")
    foot = {"r": "right", "right": "right", "l": "left", "left": "left"}.get(columns.key, "")
    if not columns.p:
        notes.append(f"{said} has no points of application; its moments are taken about the file's origin")
        return RawPlate(data[:, 0], force, free * scale, np.zeros(3), None, "mot", foot)
    origin, moment = wrench(force, point * scale, np.nan_to_num(free) * scale)
    return RawPlate(data[:, 0], force, moment, origin, None, "mot", foot)


def _take(data: Array, columns: dict[str, int]) -> Array:
    return data[:, [columns[a] for a in "xyz"]] if len(columns) == 3 else np.zeros((len(data), 3))


def _length_scale(force: Array, point: Array, free: Array) -> float:
    """1e-3 where points or moments can only be mm and N mm: no plate stands 20 m from the origin or has a lever of 20 m."""
    load = np.linalg.norm(np.nan_to_num(force), axis=1)
    on = load > 0.5 * load.max()
    lever = np.linalg.norm(free[on], axis=1) / load[on]
    return 1e-3 if max(np.nanmedian(np.abs(point[on]).max(axis=1)), np.nanmedian(lever)) > 20.0 else 1.0


def wrench(force: Array, point: Array, free: Array) -> tuple[Array, Array]:
    """A fixed origin on the plate and the moment about it, from points of application.

    force [N], point [m], free moment [N m], each of shape (k, 3).  origin: the median point under load, shape (3,).
    moment = (point - origin) x force + free, shape (k, 3), NaN without a point; shear that is not recorded (NaN) counts as none.
    """
    load = np.linalg.norm(np.nan_to_num(force), axis=1)
    on = (load > 0.2 * load.max()) & np.isfinite(point).all(axis=1)
    origin = np.median(point[on], axis=0) if on.any() else np.zeros(3)
    return origin, np.cross(point - origin, np.nan_to_num(force)) + free
