"""MATLAB's .mat, version 4 to 7.3: variables, those in structs among them, as columns (see ``structures``)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rig.errors import RecordingError
from rig.recording.readers.matlab import mat4, mat5
from rig.recording.readers.structures import Unknown, columns_of
from rig.recording.table import MAX_SAMPLES, Table, read_each

MAX_UNPACKED_BYTES = 8 * 8 * MAX_SAMPLES  # eight columns as long as may be


def read(path: Path) -> Sequence[Any]:
    """One table of all variables. Raises RecordingError where the file is no sound .mat."""
    with path.open("rb") as file:
        head = file.read(128)
    if head[:4] == b"\x89HDF" or head.startswith(b"MATLAB 7.3"):
        from rig.recording.readers import h5  # noqa: PLC0415  slow to import
        from rig.recording.readers.matlab import mat73  # noqa: PLC0415

        if path.stat().st_size > MAX_UNPACKED_BYTES:
            return h5.read(path)  # which reads no more than it is asked for
        return [_table(path, mat73.variables(path))]
    if path.stat().st_size > MAX_UNPACKED_BYTES:
        raise _too_large(path)
    data = path.read_bytes()
    try:
        found = dict(mat4.variables(data) if 0 in head[:4] else mat5.variables(data, MAX_UNPACKED_BYTES))
    except mat5.TooLargeError:
        raise _too_large(path) from None
    except (ValueError, IndexError, struct.error, zlib.error, MemoryError) as error:
        raise RecordingError(
            f"{path}: is not a .mat file that can be read ({error}): save it again with save(..., '-v7')"
        ) from error
    return [_table(path, found)]


def _table(path: Path, variables: Mapping[str, Any]) -> Table:
    columns, units = columns_of(variables)
    if not columns:
        raise RecordingError(f"{path}: holds no variables: save time_s, torque_nm, rate_rad_s as vectors")

    def get(name: str) -> Any:
        if isinstance(columns[name], Unknown):
            raise RecordingError(f"{path}: column {name!r} {columns[name].why}")
        return columns[name]

    return Table(path, tuple(columns), read_each(path, get), units=units)


def _too_large(path: Path) -> RecordingError:
    return RecordingError(
        f"{path}: unpacks to more than {MAX_UNPACKED_BYTES >> 20} MiB: cut it into runs or save fewer variables"
    )
