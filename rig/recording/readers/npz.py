"""NumPy's .npz and .npy: an array a column, or an array of columns; pickled objects are never loaded."""

from __future__ import annotations

import tokenize
import zipfile
import zlib
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import IO, Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.readers.matrices import labels_for, part_of, parts_of
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long

MOST_LABELS = 256
# NumPy reads a header as Python's text, and complains of it so.
_BAD_HEADER = (tokenize.TokenError, SyntaxError, TypeError)
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    ValueError,
    OSError,
    RuntimeError,
    KeyError,
    MemoryError,
    *_BAD_HEADER,
)

Opener = Callable[[str], AbstractContextManager[Any]]


def read(path: Path) -> Sequence[Table]:
    """One table of all arrays. Raises RecordingError where the file is no sound .npz or .npy."""
    if path.name.lower().endswith(".npy"):
        return [_table(path, [path.stem], lambda _: path.open("rb"))]
    try:
        with zipfile.ZipFile(path) as archive:
            names = [n.removesuffix(".npy") for n in archive.namelist() if n.endswith(".npy")]
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is not a .npz archive ({error}): write it again with numpy.savez") from error
    if not names:
        raise RecordingError(f"{path}: holds no arrays: write them with numpy.savez(file, time_s=..., ...)")
    return [_table(path, names, lambda name: _Member(path, f"{name}.npy"))]


class _Member(AbstractContextManager[IO[bytes]]):
    """A member of an archive, open."""

    def __init__(self, path: Path, member: str) -> None:
        self._path, self._member = path, member

    def __enter__(self) -> IO[bytes]:
        self._archive = zipfile.ZipFile(self._path)
        return self._archive.open(self._member)

    def __exit__(self, *_: object) -> None:
        self._archive.close()


def _table(path: Path, names: Sequence[str], opened: Opener) -> Table:
    # A column is an array, or a part of one.
    columns: dict[str, tuple[str, int | str | None]] = {name: (name, None) for name in names}
    kinds = {name: kind for name in names if (kind := _kind(name, opened)) is not None}
    texts = [
        [str(text) for text in np.ravel(_array(path, name, opened))]
        for name, (shape, dtype) in kinds.items()
        if dtype.kind in "US" and len(shape) == 1 and shape[0] <= MOST_LABELS and dtype.itemsize <= 1000
    ]
    for name, (shape, dtype) in kinds.items():
        labels = labels_for(min(shape), texts) if len(shape) == 2 else []
        parts = parts_of(name, shape, dtype.names, labels, columns)
        columns |= {column: (name, at) for column, at in parts.items()}

    def get(column: str) -> Any:
        name, at = columns[column]
        values = _array(path, name, opened)
        return values if at is None else part_of(values, at)

    return Table(path, tuple(columns), read_each(path, get))


def _kind(name: str, opened: Opener) -> tuple[tuple[int, ...], np.dtype[Any]] | None:
    """Shape and type as the header says; None where it cannot be read, which reading the array says."""
    try:
        with opened(name) as file:
            return _header(file)
    except _DAMAGE:
        return None


def _array(path: Path, name: str, opened: Opener) -> Any:
    try:
        # The header is read first: a few bytes may announce an array that fills the memory.
        with opened(name) as file:
            shape, dtype = _header(file)
        count = int(np.prod(shape, dtype=object))
        if dtype.hasobject:
            raise RecordingError(
                f"{path}: column {name!r} holds Python objects, which are never loaded (they can run code): "
                "save it as numbers, e.g. numpy.asarray(x, dtype=float)"
            )
        if count * max(1, dtype.itemsize) > 16 * MAX_SAMPLES and len(shape) < 2 and dtype.names is None:
            raise too_long(path, count)
        if count * max(1, dtype.itemsize) > 64 * MAX_SAMPLES:
            raise RecordingError(f"{path}: array {name!r} has {count} numbers: cut it into runs or leave columns out")
        with opened(name) as file:
            return np.lib.format.read_array(file, allow_pickle=False)
    except _DAMAGE as error:
        raise RecordingError(f"{path}: array {name!r} is damaged ({error}): export the file again") from error


def _header(file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(file)
    reader = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = reader(file)
    return shape, dtype
