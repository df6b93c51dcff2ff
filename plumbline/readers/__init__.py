"""Readers of recordings: one file in, one :class:`plumbline.readers.raw.Raw` out, in SI and the lab's own axes."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, cast

from plumbline.errors import Refused
from plumbline.readers.raw import Raw

DATA_FILES = ("c3d.py",)  # named as text below, so that only the child imports it; see plumbline/provenance.py
OPENSIM = (".trc", ".mot", ".sto")
TEXT = (".csv", ".txt", ".tsv", ".dat")
KISTLER = b"CPlateEight"  # BioWare writes its classes by name near the top
EXPORT = "export the recording as C3D, TRC + MOT or delimited text"


def read_file(path: Path, columns: Sequence[Mapping[str, Any]] = ()) -> Raw:
    """Read one recording by its ending; C3D in a child process with limits on memory and time.

    columns: the config's entries for text and parquet files.  Raises Refused with the reason, whatever the file holds.
    """
    ending = path.suffix.lower()
    if not path.is_file():
        raise Refused("missing_file", f"{path.name} is not there", "check the path")
    if path.stat().st_size == 0:
        raise Refused("empty_file", f"{path.name} holds no bytes", "export the recording again")
    if ending == ".c3d":
        from plumbline.readers import child

        return cast(Raw, child.guarded("plumbline.readers.c3d:read", path))
    if ending in OPENSIM:
        from plumbline.readers import opensim

        return opensim.read(path)
    if ending != ".parquet" and (_described(path, columns) or (ending in TEXT and not _kistler(path))):
        from plumbline.readers import text

        return text.read(path, columns)
    if ending == ".parquet":
        from plumbline.readers import parquet

        return parquet.read(path, columns)
    raise Refused("unsupported", f"{path.name}: {_what(ending)}", EXPORT)


def _described(path: Path, columns: Sequence[Mapping[str, Any]]) -> bool:
    """Whether the config says what the columns of this file are: then it is text, whatever its ending."""
    return any(fnmatch(path.name.lower(), str(entry["files"]).lower()) for entry in columns)


def _kistler(path: Path) -> bool:
    """Whether a .dat is the binary file of Kistler's BioWare."""
    with path.open("rb") as file:
        return KISTLER in file.read(512)


def _what(ending: str) -> str:
    """A known kind of file without a reader, in words."""
    kinds = {
        ".anc": "there is no reader for analog files of Motion Analysis (.anc)",
        ".dat": "there is no reader for binary files of Kistler BioWare (.dat)",
        ".b3d": "there is no reader for AddBiomechanics binaries (.b3d)",
    }
    return kinds.get(ending, f"there is no reader for {ending or 'files without an ending'}")
