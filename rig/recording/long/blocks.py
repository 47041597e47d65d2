"""A file of columns of which any rows can be read without the rest: HDF5, and Parquet in its row groups."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.memory import at_most
from rig.recording.table import Table, index_label, plain_column

BLOCK_ROWS = 1 << 18  # rows that are read at once
MOST_CHUNK_BYTES = 64 << 20  # of a file: a chunk is unpacked as a whole
MOST_GROUP_ROWS = 4 << 20  # of a row group, which is
SHORT_BYTES = 1 << 18  # a smaller file holds nothing long, packed or not as recordings are

Read = Callable[[Sequence[str], int, int], Mapping[str, Array]]


@dataclass(frozen=True)
class BlockTable:
    """Named columns of ``count`` rows; ``read`` gives rows first..last (excluded), as float64."""

    path: Path
    names: tuple[str, ...]
    count: int
    read: Read
    label: Callable[[int], str] = index_label
    units: Mapping[str, str] = field(default_factory=dict)

    def rows(self, first: int = 0, last: int | None = None) -> Table:
        """These rows as a table; a row in a message is still called by where it stands in the file."""
        end = self.count if last is None else last
        return Table(
            self.path, self.names, lambda names: self.read(names, first, end),
            lambda index: self.label(first + index), self.units, first,
        )  # fmt: skip


def block_table(path: Path) -> BlockTable | None:
    """The file by its rows; None where it has to be read as a whole, or cannot be read: its reader says why."""
    suffix = path.suffix.lower()
    try:
        if not path.is_file() or path.stat().st_size < SHORT_BYTES:
            return None
        if suffix in (".h5", ".hdf5"):
            return _of_h5(path)
        return _of_parquet(path) if suffix == ".parquet" else None
    except (RecordingError, OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, MemoryError):
        return None


def _of_h5(path: Path) -> BlockTable | None:
    import h5py  # noqa: PLC0415  slow to import

    from rig.recording import hdf5  # noqa: PLC0415
    from rig.recording.h5_heaps import check_heaps  # noqa: PLC0415
    from rig.recording.readers import h5  # noqa: PLC0415

    check_heaps(path)
    with h5py.File(path, "r") as file, at_most(hdf5.MAX_TEXT_BYTES):
        if file.attrs.get("format") == hdf5.FORMAT:
            return None
        inner = h5.datasets(file)
        columns = {name: file[at] for name, at in inner.items()}
        plain = {name for name, data in columns.items() if _is_plain(data)}
        units = h5.units_of(file, inner)
        counts = {columns[name].shape[0] for name in plain}
    if len(counts) != 1:
        return None

    def read(names: Sequence[str], first: int, last: int) -> Mapping[str, Array]:
        with h5py.File(path, "r") as file:
            return {name: _h5_rows(path, name, file[inner[name]], first, last) for name in names}

    return BlockTable(path, tuple(inner), counts.pop(), read, units=units)


def _is_plain(data: Any) -> bool:
    chunk = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize if data.chunks else 0
    stands_here = not (data.external or data.is_virtual)
    return data.ndim == 1 and data.dtype.kind in "fiub" and stands_here and chunk <= MOST_CHUNK_BYTES


def _h5_rows(path: Path, name: str, data: Any, first: int, last: int) -> Array:
    if not _is_plain(data):
        raise RecordingError(f"{path}: {name!r} is not a plain column of numbers in this file: copy it in (h5repack)")
    try:
        return plain_column(path, name, data[first:last])
    except (OSError, RuntimeError, ValueError, MemoryError) as error:
        raise RecordingError(f"{path}: dataset {name!r} is damaged ({error}): export it again") from error


def _of_parquet(path: Path) -> BlockTable | None:
    if find_spec("pyarrow") is None:
        return None

    parquet = import_module("rig.recording.extra_readers.parquet")

    file = parquet.opened(path)
    sizes = [file.metadata.row_group(i).num_rows for i in range(file.metadata.num_row_groups)]
    if not sizes or max(sizes) > MOST_GROUP_ROWS:
        return None
    begins = np.concatenate([[0], np.cumsum(sizes)])
    schema = file.schema_arrow
    if any(kind in str(f.type) for f in schema for kind in ("timestamp", "duration", "struct")):
        return None  # seconds since the first row, which a later group does not know

    def read(names: Sequence[str], first: int, last: int) -> Mapping[str, Array]:
        groups = [i for i in range(len(sizes)) if begins[i] < last and begins[i + 1] > first]
        table = parquet.opened(path).read_row_groups(groups, columns=list(names))
        at = int(begins[groups[0]])
        values = parquet.columns_of(path, table, names)
        return {name: column[first - at : last - at] for name, column in values.items()}

    names = tuple(name for name in schema.names if name)
    return BlockTable(path, names, int(begins[-1]), read, lambda index: f"row {index + 1}", parquet.units_of(schema))
