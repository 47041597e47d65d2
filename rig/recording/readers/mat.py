"""MATLAB's .mat: version 4 to 7 here, 7.3 is HDF5; a struct's fields are called `struct.field`.

Numeric arrays and structs of them only. `scipy.io.loadmat` was the first choice, but one changed byte in a
file can make it write outside its memory (it crashed within a hundred mutated files), and a crash is no
way to refuse a recording. Source: MathWorks, "MAT-File Format", R2022a.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.readers import mat4
from rig.recording.table import MAX_SAMPLES, Table, read_each

MAX_UNPACKED_BYTES = 8 * 8 * MAX_SAMPLES  # eight columns as long as may be
MAX_STRUCT_DEPTH = 5

_MATRIX, _COMPRESSED = 14, 15
_STORED_AS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_STRUCT, _FIRST_NUMERIC, _LAST_NUMERIC = 2, 6, 15
_COMPLEX_FLAG = 0x0800
_NOT_NUMBERS = np.empty(0, dtype=object)


class _Damaged(ValueError):
    """The file is not what the format says."""


def read(path: Path) -> Sequence[Any]:
    """One table of all variables. Raises RecordingError where the file is no sound .mat."""
    with path.open("rb") as file:
        head = file.read(128)
    if head[:4] == b"\x89HDF" or head.startswith(b"MATLAB 7.3"):
        from rig.recording.readers import h5  # noqa: PLC0415  slow to import

        return h5.read(path)
    if path.stat().st_size > MAX_UNPACKED_BYTES:
        raise _too_large(path)
    data = path.read_bytes()
    try:
        columns = dict(mat4.variables(data) if 0 in head[:4] else _variables(path, data))
    except (ValueError, IndexError, struct.error, zlib.error, MemoryError) as error:
        raise RecordingError(
            f"{path}: is not a .mat file that can be read ({error}): save it again with save(..., '-v7')"
        ) from error
    if not columns:
        raise RecordingError(f"{path}: holds no variables: save time_s, torque_nm, rate_rad_s as vectors")
    return [Table(path, tuple(columns), read_each(path, columns.__getitem__))]


def _too_large(path: Path) -> RecordingError:
    return RecordingError(
        f"{path}: unpacks to more than {MAX_UNPACKED_BYTES >> 20} MiB: cut it into runs or save fewer variables"
    )


@dataclass
class _Elements:
    """A stretch of data elements: type and content, one after the other, in the file's byte order."""

    data: memoryview
    order: str
    position: int = 0

    def __bool__(self) -> bool:
        return self.position < len(self.data)

    def next(self) -> tuple[int, memoryview]:
        kind, length = struct.unpack_from(self.order + "II", self.data, self.position)
        if kind >> 16:  # small element: length and type share a word, the content the next one
            kind, length, start, step = kind & 0xFFFF, kind >> 16, self.position + 4, 8
            if length > 4:
                raise _Damaged(f"a small element of {length} bytes")
        else:
            start = self.position + 8
            step = 8 + (length if kind == _COMPRESSED else -(-length // 8) * 8)
        if start + length > len(self.data):
            raise _Damaged(f"it ends {start + length - len(self.data)} bytes too early")
        self.position += step
        return kind, self.data[start : start + length]


def _variables(path: Path, data: bytes) -> Iterator[tuple[str, Any]]:
    if not data.startswith(b"MATLAB") or data[126:128] not in (b"IM", b"MI"):
        raise _Damaged("it does not begin as one")
    order = "<" if data[126:128] == b"IM" else ">"
    room = MAX_UNPACKED_BYTES
    top = _Elements(memoryview(data)[128:], order)
    while top:
        kind, content = top.next()
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(content, room)
            room -= len(unpacked)
            if unpacker.unconsumed_tail or room <= 0:
                raise _too_large(path)
            kind, content = _Elements(memoryview(unpacked), order).next()
        if kind == _MATRIX:
            yield from _matrix(content, order, "", 0)


def _matrix(content: memoryview, order: str, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Name and values of an array; of a struct, those of its fields."""
    if not content:
        return  # an empty field of a struct
    parts = _Elements(content, order)
    flags = struct.unpack_from(order + "I", parts.next()[1])[0]
    shape = tuple(int(n) for n in _numbers(*parts.next(), order))
    name = prefix + bytes(parts.next()[1]).decode("latin-1")
    kind = flags & 0xFF
    if _FIRST_NUMERIC <= kind <= _LAST_NUMERIC:
        yield name, _array(parts, shape, bool(flags & _COMPLEX_FLAG), order)
    elif kind == _STRUCT and depth < MAX_STRUCT_DEPTH and all(n == 1 for n in shape):
        width = int(_numbers(*parts.next(), order)[0])
        text = bytes(parts.next()[1])
        if not 0 < width <= 64:
            raise _Damaged(f"field names of {width} characters")
        for start in range(0, len(text), width):
            field = text[start : start + width].split(b"\0")[0].decode("latin-1")
            inner_kind, inner = parts.next()
            if inner_kind != _MATRIX:
                raise _Damaged(f"field {field!r} is no array")
            # The array inside has no name of its own: the field's is put in front.
            yield from _matrix(inner, order, f"{name}.{field}", depth + 1)
    else:
        yield name, _NOT_NUMBERS


def _numbers(kind: int, content: memoryview, order: str) -> Any:
    if kind not in _STORED_AS:
        raise _Damaged(f"numbers of type {kind}")
    return np.frombuffer(content, dtype=order + _STORED_AS[kind])


def _array(parts: _Elements, shape: tuple[int, ...], is_complex: bool, order: str) -> Any:
    values = _numbers(*parts.next(), order)
    if len(shape) < 2 or any(n < 0 for n in shape) or values.size != int(np.prod(shape, dtype=object)):
        raise _Damaged(f"{values.size} values for the shape {shape}")
    values = values.reshape(shape, order="F")
    return values + 1j * _numbers(*parts.next(), order).reshape(shape, order="F") if is_complex else values
