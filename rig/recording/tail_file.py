"""An append-only file in which a write never waits for the sync that is under way.

While a file is being synced the kernel holds its inode and its pages now and then: on ext4 beside a program that
fills the disk a write to that same file was held up for a tenth of a second, one to another file for milliseconds
(docs/recordings.md). So what comes during a sync goes to a second file, ``NAME.tail``, which is never synced, and to
the first one as soon as the sync is over. A kill leaves both, and readers put them together.

    tail   = records one behind the other, begun anew where the file has everything; between them remains of older ones
    record = "ISPT", offset in the file (u64), length (u32), CRC-32 of offset, length and bytes; bytes   (little-endian)
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
import struct
import threading
import zlib
from pathlib import Path
from typing import BinaryIO

from rig.recording.flushing import sync

SUFFIX = ".tail"
MARKER = b"ISPT"
_HEAD = struct.Struct("<4sQII")
_SUMMED = struct.Struct("<QI")
RESERVED_BYTES = 256 * 1024  # half a second of a bench: pages that are there already need nothing of the file system
LONGEST_TAIL = 64 * 1024 * 1024
LONGEST_JOINED = 2 << 30


def tail_of(path: Path) -> Path:
    """The file beside ``path`` that takes what comes while it is synced."""
    return path.with_name(path.name + SUFFIX)


def record(offset: int, data: bytes) -> bytes:
    """One record of a tail: these bytes stand at ``offset`` of the file."""
    head = _SUMMED.pack(offset, len(data))
    return _HEAD.pack(MARKER, offset, len(data), zlib.crc32(data, zlib.crc32(head))) + data


class TailedFile:
    """Writer. ``write`` and ``sync`` may be called by two threads at once. All methods raise OSError.

    A new file is made, an existing one never overwritten.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.written = 0
        """Bytes in the file itself: those in the tail come to it later."""
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644)
        self._tail: int | None = None
        self._tail_end = 0
        self._behind: list[bytes] = []  # accepted, but not yet in the file itself
        self._turn = threading.Lock()  # never held while the disk syncs
        self._syncing = False
        self._synced = 0

    def expect_syncs(self) -> None:
        """From here on ``sync`` may be called beside ``write``: make the tail. Never raises."""
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
        if self._tail is None:
            with contextlib.suppress(OSError):
                self._tail = os.open(tail_of(self.path), flags, 0o644)
                os.write(self._tail, bytes(RESERVED_BYTES))

    def write(self, data: bytes) -> None:
        """Append, so that a kill leaves it. Where OSError is raised nothing of ``data`` was taken."""
        with self._turn:
            if self._syncing and self._to_tail(data):
                self._behind.append(data)
            else:
                self._append(data)

    def _to_tail(self, data: bytes) -> bool:
        if self._tail is None or self._tail_end + _HEAD.size + len(data) > LONGEST_TAIL:
            return False
        offset = self.written + sum(map(len, self._behind))
        try:
            os.lseek(self._tail, self._tail_end, os.SEEK_SET)
            _write_all(self._tail, record(offset, data))
        except OSError:
            return False  # the file itself will say what is wrong
        self._tail_end += _HEAD.size + len(data)
        return True

    def _append(self, data: bytes) -> None:
        data = b"".join((*self._behind, data))
        try:
            _write_all(self._descriptor, data)
        except OSError:
            # A frame cut by a full disk would hide whatever is appended once there is room again.
            os.ftruncate(self._descriptor, self.written)
            os.lseek(self._descriptor, self.written, os.SEEK_SET)
            raise
        self.written += len(data)
        self._behind.clear()
        self._tail_end = 0

    def sync(self) -> None:
        """See to it that what was written until now survives a power cut; at once where it does already."""
        with self._turn:
            if self._behind:
                self._append(b"")
            written = self.written
            if written == self._synced:
                return
            self._syncing = True
        try:
            sync(self._descriptor)
        finally:
            with self._turn:
                self._syncing = False
        self._synced = written

    def close(self) -> None:
        """Close; without its tail, where the file itself has everything."""
        try:
            with self._turn:
                if self._behind:
                    self._append(b"")
        finally:
            os.close(self._descriptor)
            if self._tail is not None:
                os.close(self._tail)
        if self._tail is not None:
            with contextlib.suppress(OSError):
                tail_of(self.path).unlink()


def _write_all(descriptor: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(descriptor, view) :]


def whole(path: Path) -> bytes:
    """The file with what only its tail has behind it. Raises OSError."""
    data = path.read_bytes()
    return data + missing_of(path, len(data))


def opened(path: Path) -> BinaryIO:
    """The same to be read in pieces; of a file too long to be joined in memory, the file itself. Raises OSError."""
    is_joined = tail_of(path).exists() and path.stat().st_size <= LONGEST_JOINED
    return io.BytesIO(whole(path)) if is_joined else path.open("rb")


def missing_of(path: Path, size: int) -> bytes:
    """What a kill left in the tail only, where the file itself has ``size`` bytes; empty where there is no tail."""
    tail = tail_of(path)
    try:
        found = tail.lstat()
        # A folder comes from anywhere: no link is followed, no pipe waited for.
        if not stat.S_ISREG(found.st_mode) or found.st_size > LONGEST_TAIL:
            return b""
        data = tail.read_bytes()
    except OSError:
        return b""
    missing = bytearray()
    for offset, piece in sorted(_records(data)):
        known = size + len(missing)
        if offset <= known < offset + len(piece):
            missing += piece[known - offset :]
    return bytes(missing)


def _records(data: bytes) -> list[tuple[int, bytes]]:
    """Sound records: (offset, bytes)."""
    found, at = [], data.find(MARKER)
    worth_trying = 4 * len(data)  # bytes: a file made of heads that lie must not take for ever
    while 0 <= at <= len(data) - _HEAD.size and worth_trying >= 0:
        _, offset, length, crc = _HEAD.unpack_from(data, at)
        start = at + _HEAD.size
        at += 1
        if start + length <= len(data):
            piece = data[start : start + length]
            worth_trying -= length
            if zlib.crc32(piece, zlib.crc32(_SUMMED.pack(offset, length))) == crc:
                found.append((offset, piece))
                at = start + length
        at = data.find(MARKER, at)
    return found
