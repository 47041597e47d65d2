"""HDF5: our own recording.h5, or datasets of one group with a column each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rig.errors import RecordingError
from rig.recording import hdf5
from rig.recording.h5_heaps import check_heaps
from rig.recording.memory import at_most
from rig.recording.readers.matrices import MOST_COLUMNS, labels_for, part_of, parts_of
from rig.recording.run import Run
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long

UNIT_ATTRIBUTES = ("units", "unit", "Units", "Unit")
LONGEST_UNIT_BYTES = 1000
MOST_BYTES = 16 * MAX_SAMPLES  # of a column
MOST_BYTES_OF_SEVERAL = 64 * MAX_SAMPLES  # of a matrix or a table
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, MemoryError)


def read(path: Path) -> Sequence[Table | Run]:
    """The runs of our own file, else one table of all datasets. Raises RecordingError where unreadable."""
    try:
        check_heaps(path)
        with h5py.File(path, "r") as file:
            with at_most(hdf5.MAX_TEXT_BYTES):
                ours = file.attrs.get("format") == hdf5.FORMAT
            columns = {} if ours else datasets(file)
            with at_most(hdf5.MAX_TEXT_BYTES):
                units = units_of(file, columns)
                parts = _parts(file, columns)
    except _DAMAGE as error:
        raise RecordingError(f"{path}: is not an HDF5 file that can be read ({error}): export it again") from error
    if ours:
        return hdf5.read_recording_h5(path, with_info=False).runs
    if not columns:
        raise RecordingError(f"{path}: holds no datasets: write time_s, torque_nm, rate_rad_s as datasets")

    def get(name: str) -> Any:
        if name not in parts:
            return _array(path, name, columns[name], MOST_BYTES)
        inner, at = parts[name]
        return part_of(_array(path, name, inner, MOST_BYTES_OF_SEVERAL), at)

    return [Table(path, (*columns, *parts), read_each(path, get), units=units)]


def _parts(file: h5py.File, columns: Mapping[str, str]) -> dict[str, tuple[str, int | str]]:
    """Column -> dataset and place, of datasets that hold several: matrices, and PyTables' and pandas' tables."""
    found: dict[str, tuple[str, int | str]] = {}
    for name, inner in columns.items():
        data = file[inner]
        labels = labels_for(min(data.shape), _texts_beside(data)) if len(data.shape) == 2 else []
        for column, at in parts_of(name, data.shape, data.dtype.names, labels, {**columns, **found}).items():
            found[column] = inner, at
    return found


def _texts_beside(data: h5py.Dataset) -> Iterator[list[str]]:
    """Lists of texts in the same group, which may be the names of a matrix's columns."""
    for name in data.parent:
        other = data.parent.get(name) if isinstance(data.parent.get(name, getlink=True), h5py.HardLink) else None
        if not isinstance(other, h5py.Dataset) or len(other.shape) != 1 or not 1 < other.shape[0] <= MOST_COLUMNS:
            continue
        is_text = other.dtype.kind == "S" or h5py.check_string_dtype(other.dtype) is not None
        if is_text and other.id.get_storage_size() <= LONGEST_UNIT_BYTES * other.shape[0]:
            yield [t.decode("utf-8", "replace") if isinstance(t, bytes) else str(t) for t in other[()]]


def datasets(file: h5py.File) -> dict[str, str]:
    """Column name -> path in the file: the last part of the path where that is unique, else all of it.

    Links are not followed: a link may lead into another file.
    """
    paths: list[str] = []

    def visit(path: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not path.startswith("#refs#"):  # MATLAB keeps cells there
            paths.append(path)

    file.visititems(visit)
    leaves = Counter(path.rpartition("/")[2] for path in paths)
    return {leaf if leaves[leaf := path.rpartition("/")[2]] == 1 else path: path for path in paths}


def units_of(file: h5py.File, columns: Mapping[str, str]) -> dict[str, str]:
    """Column -> unit, where an attribute of its dataset states one."""
    found: dict[str, str] = {}
    for name, inner in columns.items():
        attributes = file[inner].attrs
        key = next((key for key in UNIT_ATTRIBUTES if key in attributes), None)
        if key is not None and (text := text_of(attributes, key)):
            found[name] = text
    return found


def text_of(attributes: h5py.AttributeManager, key: str) -> str:
    """A text, whether it is kept as one, as bytes or as an array of one; empty for anything else."""
    kept = attributes.get_id(key)
    if kept.get_storage_size() > LONGEST_UNIT_BYTES or kept.shape not in ((), (1,)):
        return ""
    value = np.asarray(attributes[key]).reshape(-1)[0]
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return text.strip() if isinstance(text, str) else ""


def _array(path: Path, name: str, inner: str, most_bytes: int) -> Any:
    try:
        with h5py.File(path, "r") as file:
            dataset = file[inner]
            if dataset.external or dataset.is_virtual:
                raise RecordingError(
                    f"{path}: {name!r} keeps its values in another file: copy them into this one (h5repack)"
                )
            if dataset.dtype.hasobject:
                raise RecordingError(f"{path}: column {name!r} holds texts or lists, not numbers: save it as numbers")
            count = int(np.prod(dataset.shape or (0,), dtype=object))
            if count * max(1, dataset.dtype.itemsize) > most_bytes:
                raise too_long(path, count)
            with at_most(hdf5.MAX_READ_BYTES):
                return dataset[()]
    except _DAMAGE as error:
        raise RecordingError(f"{path}: dataset {name!r} is damaged ({error}): export it again") from error
