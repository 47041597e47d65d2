"""MATLAB's .mat, version 7.3: HDF5, in which cells and arrays of structs are references to what they hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rig.errors import RecordingError
from rig.recording import hdf5
from rig.recording.h5_heaps import check_heaps
from rig.recording.memory import at_most
from rig.recording.readers.h5 import text_of
from rig.recording.readers.matlab.mat5 import MAX_STRUCT_DEPTH, OBJECT
from rig.recording.readers.structures import Struct, Unknown
from rig.recording.table import MAX_SAMPLES

MAX_OBJECTS = 100_000  # of a file, those that are referred to twice counted twice
MAX_ARRAY_BYTES = 64 * MAX_SAMPLES  # of one array
CLASS, IS_OBJECT, IS_EMPTY = "MATLAB_class", "MATLAB_object_decode", "MATLAB_empty"
_DAMAGE = (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, MemoryError)
_ELSEWHERE = "keeps its values in another file: save it again with save(..., '-v7')"


def variables(path: Path) -> Mapping[str, Any]:
    """The variables, as ``structures.columns_of`` takes them. Raises RecordingError where the file is damaged."""
    try:
        check_heaps(path)
        with h5py.File(path, "r") as file, at_most(hdf5.MAX_READ_BYTES):
            return _Reader(file).fields(file, 0)
    except _DAMAGE as error:
        raise RecordingError(
            f"{path}: is not a .mat file that can be read ({error}): save it again with save(..., '-v7')"
        ) from error


@dataclass
class _Reader:
    """Reads what an open file holds, and counts it: references may lead in a circle."""

    file: h5py.File
    count: int = 0

    def fields(self, group: h5py.Group, depth: int) -> dict[str, Any]:
        """Name -> value of a group; links that lead elsewhere are not followed."""
        own = [name for name in group if isinstance(group.get(name, getlink=True), h5py.HardLink)]
        return {name: self.value(group[name], depth) for name in own if not name.startswith("#")}

    def value(self, item: Any, depth: int) -> Any:
        """An array, a text, a list, a Struct or Unknown."""
        self.count += 1
        if self.count > MAX_OBJECTS:
            raise ValueError(f"more than {MAX_OBJECTS} arrays in it")
        if depth > MAX_STRUCT_DEPTH:
            return Unknown(f"lies more than {MAX_STRUCT_DEPTH} structs deep: save it as an array")
        if IS_OBJECT in item.attrs:
            return Unknown(OBJECT)
        return self._struct(item, depth) if isinstance(item, h5py.Group) else self._dataset(item, depth)

    def _dataset(self, item: h5py.Dataset, depth: int) -> Any:
        kind = text_of(item.attrs, CLASS) if CLASS in item.attrs else ""
        if IS_EMPTY in item.attrs:
            return "" if kind == "char" else np.empty((0, 0))
        if item.external or item.is_virtual:
            return Unknown(_ELSEWHERE)
        if h5py.check_ref_dtype(item.dtype) is not None:
            return [self.value(self.file[ref], depth + 1) for ref in self._references(item)]
        if item.dtype.kind not in "fiubc" or item.size * item.dtype.itemsize > MAX_ARRAY_BYTES:
            return Unknown("holds no numbers, or too many: save it as arrays of at most 10 000 000 numbers")
        values = np.asarray(item[()]).T  # HDF5 has MATLAB's dimensions the other way round
        return _text(values) if kind == "char" else values

    def _struct(self, group: h5py.Group, depth: int) -> Any:
        own = [name for name in group if isinstance(group.get(name, getlink=True), h5py.HardLink)]
        arrays = [group[name] for name in own]
        if own and all(_is_array_of_structs(item) for item in arrays):
            columns = [self._references(item) for item in arrays]
            rows = zip(*columns, strict=True)
            return Struct(
                tuple(
                    {name: self.value(self.file[ref], depth + 1) for name, ref in zip(own, row, strict=True)}
                    for row in rows
                )
            )
        return Struct((self.fields(group, depth + 1),))

    def _references(self, item: h5py.Dataset) -> list[Any]:
        if item.size > MAX_OBJECTS:
            raise ValueError(f"more than {MAX_OBJECTS} arrays in one")
        return [ref for ref in np.ravel(np.asarray(item[()]).T, order="F") if ref]


def _is_array_of_structs(item: Any) -> bool:
    """Whether a field of a group is one of an array of structs: references, and no cell."""
    return (
        isinstance(item, h5py.Dataset) and h5py.check_ref_dtype(item.dtype) is not None and CLASS not in item.attrs
    )  # fmt: skip


def _text(codes: Any) -> Any:
    """A text, or a list of them where it has several rows."""
    if not np.size(codes):
        return ""  # whatever number of rows without a character it claims
    rows = ["".join(chr(int(c)) for c in np.atleast_1d(row)).rstrip("\0 ") for row in np.atleast_2d(codes)]
    return rows if len(rows) > 1 else "".join(rows)
