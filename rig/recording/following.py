"""Reading a journal while it is being written, from another process: whole frames as they appear."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rig.arrays import Array
from rig.recording.journal import BLOCK_HEAD, FRAME_HEAD, MARKER, MAX_FRAME_BYTES

MAX_AT_ONCE = 4 * 1024 * 1024  # bytes of one look


class JournalFollower:
    """What a journal has had since the last look. A frame that is not whole yet is left for the next look."""

    def __init__(self, path: Path) -> None:
        self._path, self._position = path, 0

    def new_frames(self) -> Iterator[tuple[int, bytes]]:
        """Type and payload of every frame that is whole by now. Raises OSError where the file cannot be read."""
        with self._path.open("rb") as file:
            file.seek(self._position)
            data = file.read(MAX_AT_ONCE)
        at = 0
        while len(data) - at >= FRAME_HEAD.size:
            marker, kind, length, crc = FRAME_HEAD.unpack_from(data, at)
            end = at + FRAME_HEAD.size + length
            if marker != MARKER or length > MAX_FRAME_BYTES or end > len(data):
                break
            payload = data[at + FRAME_HEAD.size : end]
            if zlib.crc32(payload, zlib.crc32(struct.pack("<BI", kind, length))) != crc:
                break
            at = end
            self._position += FRAME_HEAD.size + length
            yield kind, payload


def rows_of(block: bytes) -> tuple[str, Array]:
    """Kind and rows, shape (n, columns), of a BLOCK."""
    name, width = BLOCK_HEAD.unpack_from(block)
    rows = np.frombuffer(block, dtype="<f8", offset=BLOCK_HEAD.size).reshape(-1, width)
    return name.rstrip(b"\0").decode("ascii"), rows.astype(np.float64)
