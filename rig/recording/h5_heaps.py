"""Checks that the text heaps of an HDF5 file end.

The library walks a heap from object to object by the sizes that stand there; over one object of no size it walks on the
spot for ever, and no signal gets through to Python meanwhile. So they are walked here before the library sees the file.
Source: The HDF Group, "HDF5 File Format Specification 3.0", III.E, Disk Format: Level 1E, Global Heap.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path

from rig.errors import RecordingError

SIGNATURE = b"\x89HDF\r\n\x1a\n"
HEAP = b"GCOL\x01\0\0\0"
MAX_USER_BLOCK = 1 << 20
STRIDE = 64 << 20  # bytes that are looked through at once: of a long recording the map would fill the memory
MAX_TEXTS = 500_000  # of a file; each costs a microsecond here


def check_heaps(path: str | Path) -> None:
    """Raises RecordingError where a heap has no end, OSError where the file cannot be read."""
    with Path(path).open("rb") as file:
        file.seek(0, 2)
        if not file.tell():
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            _check(Path(path), data)


def _check(path: Path, data: mmap.mmap) -> None:
    width = _width_of_sizes(data)
    texts = 0
    at = _next_heap(data, 0) if width else -1
    while at >= 0:
        for step in _steps(data, at, width):
            texts += 1
            if step <= 0:
                raise RecordingError(f"{path}: is damaged (its string heap is endless): export it again")
            if texts > MAX_TEXTS:
                raise RecordingError(f"{path}: holds more than {MAX_TEXTS} texts: keep the columns of numbers only")
        at = _next_heap(data, at + 1)


def _next_heap(data: mmap.mmap, start: int) -> int:
    """Where the next heap begins, -1 where none does; what was looked through is given back as memory."""
    for first in range(start, len(data), STRIDE):
        at = data.find(HEAP, first, first + STRIDE + len(HEAP) - 1)
        if at >= 0:
            return at
        if hasattr(data, "madvise"):  # not on Windows, where a process is not charged with a file's pages
            data.madvise(mmap.MADV_DONTNEED)
    return -1


def _width_of_sizes(data: mmap.mmap) -> int:
    """Bytes of a size in this file; 0 where it is no HDF5 file."""
    at = 0
    while at <= min(MAX_USER_BLOCK, len(data) - 16):
        if data[at : at + 8] == SIGNATURE:
            return min(data[at + (14 if data[at + 8] < 2 else 10)], 8)  # the library takes no wider one
        at = 2 * at or 512
    return 0


def _steps(data: mmap.mmap, heap: int, width: int) -> Iterator[int]:
    """How far the library walks from each object of a heap to the next; 0 where it does not move on."""

    def aligned(size: int) -> int:
        return (size + 7) & ~7

    head = aligned(8 + width)  # of the heap and of each object alike
    end = min(heap + int.from_bytes(data[heap + 8 : heap + 8 + width], "little"), len(data))
    at, largest = heap + head, 1 << 8 * width
    while at + head <= end:
        index = int.from_bytes(data[at : at + 2], "little")
        size = int.from_bytes(data[at + 8 : at + 8 + width], "little")
        step = size if index == 0 else head + aligned(size)  # index 0 is free space, its head included
        yield step if step < largest else 0  # a sum that does not fit wraps round, and leads back
        at += step or end
