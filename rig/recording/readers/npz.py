"""NumPy's .npz: one array a column; pickled objects are never loaded."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long

_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, ValueError, OSError, RuntimeError, KeyError, MemoryError)


def read(path: Path) -> Sequence[Table]:
    """One table of all arrays. Raises RecordingError where the file is no sound .npz."""
    try:
        with zipfile.ZipFile(path) as archive:
            members = {n.removesuffix(".npy"): n for n in archive.namelist() if n.endswith(".npy")}
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is not a .npz archive ({error}): write it again with numpy.savez") from error
    if not members:
        raise RecordingError(f"{path}: holds no arrays: write them with numpy.savez(file, time_s=..., ...)")
    return [Table(path, tuple(members), read_each(path, lambda name: _array(path, name, members[name])))]


def _array(path: Path, name: str, member: str) -> Any:
    try:
        with zipfile.ZipFile(path) as archive:
            # The header is read first: a few bytes may announce an array that fills the memory.
            with archive.open(member) as file:
                shape, dtype = _header(file)
            count = int(np.prod(shape, dtype=object))
            if dtype.hasobject:
                raise RecordingError(
                    f"{path}: column {name!r} holds Python objects, which are never loaded (they can run code): "
                    "save it as numbers, e.g. numpy.asarray(x, dtype=float)"
                )
            if count * max(1, dtype.itemsize) > 16 * MAX_SAMPLES:
                raise too_long(path, count)
            with archive.open(member) as file:
                return np.lib.format.read_array(file, allow_pickle=False)
    except _DAMAGE as error:
        raise RecordingError(f"{path}: array {name!r} is damaged ({error}): export the file again") from error


def _header(file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = reader(file)
    return shape, dtype
