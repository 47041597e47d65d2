"""MATLAB's .mat: version 4 to 7 through SciPy, 7.3 is HDF5; a struct's fields are called `struct.field`."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

from rig.errors import RecordingError
from rig.recording.readers.base import MAX_SAMPLES, Table, read_each

MAX_UNPACKED_BYTES = 16 * 8 * MAX_SAMPLES
_COMPRESSED = 15  # miCOMPRESSED of the MAT-file format, version 5


def read(path: Path) -> Sequence[Any]:
    """One table of all variables. Raises RecordingError where the file is no sound .mat."""
    with path.open("rb") as file:
        head = file.read(128)
        if head[:4] == b"\x89HDF" or b"MATLAB 7.3" in head[:20]:
            from rig.recording.readers import h5  # noqa: PLC0415  slow to import

            return h5.read(path)
        if head[:6] == b"MATLAB":
            _check_unpacked_size(path, file, "<" if head[126:128] == b"IM" else ">")
    from scipy.io import loadmat  # noqa: PLC0415  slow to import
    from scipy.io.matlab import MatReadError  # noqa: PLC0415

    damage = (ValueError, TypeError, KeyError, IndexError, OSError, NotImplementedError, OverflowError)
    try:
        content = loadmat(path, simplify_cells=True)
    except (*damage, MatReadError, AttributeError, MemoryError, zlib.error) as error:
        raise RecordingError(
            f"{path}: is no .mat file that can be read ({error}): save it again with save(..., '-v7')"
        ) from error
    columns = dict(_flat(content, ""))
    if not columns:
        raise RecordingError(f"{path}: holds no variables: save time_s, torque_nm, rate_rad_s as vectors")
    return [Table(path, tuple(columns), read_each(path, columns.__getitem__))]


def _flat(content: Mapping[str, Any], prefix: str) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in content.items():
        if isinstance(value, Mapping):
            found += _flat(value, f"{prefix}{name}.")
        elif not name.startswith("__"):
            found.append((prefix + name, value))
    return found


def _check_unpacked_size(path: Path, file: BinaryIO, order: str) -> None:
    """Refuse a file whose compressed elements unpack to more than a recording can be."""
    unpacked = 0
    while len(tag := file.read(8)) == 8:
        kind, length = struct.unpack(order + "II", tag)
        if kind != _COMPRESSED:
            file.seek(length, 1)
            continue
        unpacker = zlib.decompressobj()
        while length > 0 and (chunk := file.read(min(length, 1 << 16))):
            length -= len(chunk)
            try:
                while chunk:
                    unpacked += len(unpacker.decompress(chunk, 1 << 20))
                    chunk = unpacker.unconsumed_tail
                    _refuse_if_too_large(path, unpacked)
            except zlib.error as error:
                raise RecordingError(f"{path}: is damaged ({error}): export the file again") from error


def _refuse_if_too_large(path: Path, unpacked: int) -> None:
    if unpacked > MAX_UNPACKED_BYTES:
        raise RecordingError(
            f"{path}: unpacks to more than {MAX_UNPACKED_BYTES >> 20} MiB: cut it into runs or save fewer variables"
        )
