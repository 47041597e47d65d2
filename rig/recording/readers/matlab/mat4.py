"""MATLAB's .mat, version 4: five words, a name and a full matrix, one after the other.

Source: MathWorks, "MAT-File Format", R2022a, appendix on level 4.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

_STORED_AS = ("f8", "f4", "i4", "i2", "u2", "u1")
_HEAD_BYTES = 20
_MAX_NAME = 256


def variables(data: bytes) -> Iterator[tuple[str, Any]]:
    """Name and matrix of every variable. Raises ValueError or struct.error where the data are no such file."""
    view = memoryview(data)
    position = 0
    while position < len(view):
        order = "<" if struct.unpack_from("<i", view, position)[0] in range(1000) else ">"
        code, rows, columns, imaginary, name_length = struct.unpack_from(order + "5i", view, position)
        machine, zero, precision, kind = code // 1000, code // 100 % 10, code // 10 % 10, code % 10
        if machine not in (0, 1) or zero or precision >= len(_STORED_AS) or min(rows, columns) < 0:
            raise ValueError("it does not begin as one")
        if not 0 < name_length <= _MAX_NAME:
            raise ValueError(f"a name of {name_length} characters")
        start = position + _HEAD_BYTES + name_length
        name = bytes(view[position + _HEAD_BYTES : start - 1]).decode("latin-1")
        dtype = np.dtype(order + _STORED_AS[precision])
        parts = 2 if imaginary else 1
        position = start + parts * rows * columns * dtype.itemsize
        if position > len(view):
            raise ValueError(f"it ends {position - len(view)} bytes too early")
        values = np.frombuffer(view[start:position], dtype=dtype).reshape(parts, columns, rows)
        matrix = values[0].T + 1j * values[1].T if imaginary else values[0].T
        yield name, matrix if kind == 0 else _text(matrix) if kind == 1 else np.empty(0, dtype=object)  # sparse


def _text(codes: Any) -> Any:
    """The rows of a text, one alone as it is."""
    if not codes.size:
        return ""  # whatever number of rows without a character it claims
    rows = ["".join(chr(int(c)) if 0 <= c < 0x110000 else "?" for c in row.real).rstrip() for row in codes]
    return rows if len(rows) > 1 else rows[0] if rows else ""
