"""MATLAB's .mat, version 5 to 7: data elements one after the other, each a matrix that may hold others.

`scipy.io.loadmat` was the first choice, but one changed byte in a file can make it write outside its memory (it
crashed within a hundred mutated files), and a crash is no way to refuse a recording.
Source: MathWorks, "MAT-File Format", R2022a.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rig.recording.readers.structures import Struct, Unknown

MAX_STRUCT_DEPTH = 8  # structs and cells in each other
MAX_MATRICES = 500_000  # of a file, those within others counted
MAX_TEXT = 1 << 20  # characters

_MATRIX, _COMPRESSED, _UTF8 = 14, 15, 16
_STORED_AS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_CHARACTERS = {1: "u1", 2: "u1", 4: "u2", 16: "u1", 17: "u2", 18: "u4"}
_CELL, _STRUCT, _CHAR, _FIRST_NUMERIC, _LAST_NUMERIC, _OPAQUE = 1, 2, 4, 6, 15, 17
_COMPLEX_FLAG = 0x0800
OBJECT = (
    "is an object of MATLAB (a table, timetable, timeseries or Dataset), which only MATLAB can open: save its columns "
    "as arrays, w = T.w, or w = ts.Data and t = ts.Time"
)
_TOO_DEEP = f"lies more than {MAX_STRUCT_DEPTH} structs deep: save it as an array"
_NO_ARRAY = "is no array of numbers (sparse, or a function): save it as a full array"


class DamagedError(ValueError):
    """The file is not what the format says."""


class TooLargeError(ValueError):
    """The file unpacks to more than is read."""


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
                raise DamagedError(f"a small element of {length} bytes")
        else:
            start = self.position + 8
            step = 8 + (length if kind == _COMPRESSED else -(-length // 8) * 8)
        if start + length > len(self.data):
            raise DamagedError(f"it ends {start + length - len(self.data)} bytes too early")
        self.position += step
        return kind, self.data[start : start + length]


def variables(data: bytes, room: int) -> Iterator[tuple[str, Any]]:
    """Name and value of every variable, as ``structures.columns_of`` takes them.

    Raises TooLargeError beyond ``room`` bytes, and ValueError, struct.error, IndexError or zlib.error where the data
    are no such file.
    """
    if not data.startswith(b"MATLAB") or data[126:128] not in (b"IM", b"MI"):
        raise DamagedError("it does not begin as one")
    order = "<" if data[126:128] == b"IM" else ">"
    reader = _Reader(order)
    top = _Elements(memoryview(data)[128:], order)
    while top:
        kind, content = top.next()
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            unpacked = unpacker.decompress(content, room)
            room -= len(unpacked)
            if unpacker.unconsumed_tail or room <= 0:
                raise TooLargeError
            kind, content = _Elements(memoryview(unpacked), order).next()
        if kind == _MATRIX and content:
            name, value = reader.matrix(content, 0)
            if name:  # what objects share has no name
                yield name, value


@dataclass
class _Reader:
    """Reads matrices of one file and counts them: a short file may claim any number of empty ones."""

    order: str
    count: int = field(default=0)

    def matrix(self, content: memoryview, depth: int) -> tuple[str, Any]:
        """Name and value of an array."""
        self.count += 1
        if self.count > MAX_MATRICES:
            raise DamagedError(f"more than {MAX_MATRICES} arrays in it")
        parts = _Elements(content, self.order)
        flags = struct.unpack_from(self.order + "I", parts.next()[1])[0]
        kind = flags & 0xFF
        if kind == _OPAQUE:
            return bytes(parts.next()[1]).decode("latin-1"), Unknown(OBJECT)
        shape = tuple(int(n) for n in _numbers(*parts.next(), self.order))
        name = bytes(parts.next()[1]).decode("latin-1")
        if _FIRST_NUMERIC <= kind <= _LAST_NUMERIC:
            return name, _array(parts, shape, bool(flags & _COMPLEX_FLAG), self.order)
        if kind == _CHAR:
            return name, _text(parts, shape, self.order)
        if kind not in (_CELL, _STRUCT):
            return name, Unknown(_NO_ARRAY)
        if depth >= MAX_STRUCT_DEPTH:
            return name, Unknown(_TOO_DEEP)
        count = int(np.prod(shape, dtype=object))
        return name, self._cell(parts, count, depth) if kind == _CELL else self._struct(parts, count, depth)

    def _cell(self, parts: _Elements, count: int, depth: int) -> list[Any]:
        return [self._inner(parts, "a cell", depth) for _ in self._counted(count)]

    def _struct(self, parts: _Elements, count: int, depth: int) -> Struct:
        width = int(_numbers(*parts.next(), self.order)[0])
        text = bytes(parts.next()[1])
        if not 0 < width <= 64:
            raise DamagedError(f"field names of {width} characters")
        names = [text[at : at + width].split(b"\0")[0].decode("latin-1") for at in range(0, len(text), width)]
        # The array inside has no name of its own.
        return Struct(
            tuple({name: self._inner(parts, f"field {name!r}", depth) for name in names} for _ in self._counted(count))
        )

    def _counted(self, count: int) -> range:
        if not 0 <= count <= MAX_MATRICES:
            raise DamagedError(f"{count} arrays in one")
        return range(count)

    def _inner(self, parts: _Elements, what: str, depth: int) -> Any:
        kind, content = parts.next()
        if kind != _MATRIX:
            raise DamagedError(f"{what} is no array")
        return self.matrix(content, depth + 1)[1] if content else np.empty((0, 0))


def _numbers(kind: int, content: memoryview, order: str) -> Any:
    if kind not in _STORED_AS:
        raise DamagedError(f"numbers of type {kind}")
    return np.frombuffer(content, dtype=order + _STORED_AS[kind])


def _array(parts: _Elements, shape: tuple[int, ...], is_complex: bool, order: str) -> Any:
    values = _numbers(*parts.next(), order)
    if len(shape) < 2 or any(n < 0 for n in shape) or values.size != int(np.prod(shape, dtype=object)):
        raise DamagedError(f"{values.size} values for the shape {shape}")
    values = values.reshape(shape, order="F")
    return values + 1j * _numbers(*parts.next(), order).reshape(shape, order="F") if is_complex else values


def _text(parts: _Elements, shape: tuple[int, ...], order: str) -> Any:
    """A text, or a list of them where it has several rows."""
    kind, content = parts.next() if parts else (_UTF8, memoryview(b""))
    if kind not in _CHARACTERS or len(content) > MAX_TEXT:
        raise DamagedError(f"text of type {kind}")
    if kind == _UTF8 and (len(shape) < 2 or shape[0] <= 1):
        return bytes(content).decode("utf-8", "replace")
    codes = np.frombuffer(content, dtype=order + _CHARACTERS[kind])
    if len(shape) != 2 or min(shape) < 0 or codes.size != int(np.prod(shape, dtype=object)):
        return Unknown(_NO_ARRAY)
    if not codes.size:
        return ""  # whatever number of rows without a character it claims
    rows = ["".join(chr(min(int(c), 0x10FFFF)) for c in row).rstrip() for row in codes.reshape(shape, order="F")]
    return rows if len(rows) > 1 else "".join(rows)
