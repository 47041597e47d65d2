"""Raw capture: every byte of the gyro and every CAN frame with its time, append-only, replayable.

    file   = "ISPRAW1\\n", records
    record = kind (1 byte), time (float64, s), length (u32), payload        (little-endian)
    kinds  = G gyro bytes read · g gyro bytes sent · R frame received · S frame sent ·
             T tick (payload: torque asked for) · C clock reading · M mark (JSON)

What was written (every 25 ms) survives a kill, what was synced (every 40 ms) a power cut; a record that was cut off
or is none ends the reading, nothing before it is lost.
"""

from __future__ import annotations

import contextlib
import json
import math
import struct
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from drivers.codecs.lawicel import CanFrame
from rig.errors import Aborted, RecordingError
from rig.recording.flushing import SYNC_EVERY_S, WRITE_EVERY_S, Repeating, sync_folder
from rig.recording.tail_file import TailedFile, whole

MAGIC = b"ISPRAW1\n"
FILE_NAME = "wire.cap"
GYRO_READ, GYRO_SENT, CAN_READ, CAN_SENT = b"G"[0], b"g"[0], b"R"[0], b"S"[0]
TICK, CLOCK, MARK = b"T"[0], b"C"[0], b"M"[0]
KINDS = frozenset(b"GgRSTCM")
LONGEST_PAYLOAD = 1 << 24
LONGEST_FRAME = 64

_HEAD = struct.Struct("<BdI")
RECORD_HEAD_BYTES = _HEAD.size
RECORD_HEAD_BYTES = _HEAD.size
_CAN_HEAD = struct.Struct("<IBB")
_TORQUE_PAYLOAD = struct.Struct("<d")
_EXTENDED_FLAG, _REMOTE_FLAG, _FD_FLAG = 1, 2, 4


class Entry(NamedTuple):
    """One record."""

    kind: int
    time_s: float
    payload: bytes


def pack_frame(frame: CanFrame) -> bytes:
    """A CAN frame as the payload of a record."""
    flags = _EXTENDED_FLAG * frame.extended | _REMOTE_FLAG * frame.remote | _FD_FLAG * frame.fd
    length = frame.length if frame.remote else len(frame.data)
    return _CAN_HEAD.pack(frame.identifier, flags, length) + frame.data


def unpack_frame(payload: bytes) -> CanFrame:
    """The CAN frame in a record."""
    identifier, flags, length = _CAN_HEAD.unpack_from(payload)
    data = payload[_CAN_HEAD.size :]
    return CanFrame(
        identifier, data, bool(flags & _EXTENDED_FLAG), bool(flags & _REMOTE_FLAG), length, -1, bool(flags & _FD_FLAG)
    )


def unpack_torque(payload: bytes) -> float:
    """The torque that a tick asked for, in N m."""
    return float(_TORQUE_PAYLOAD.unpack(payload)[0])


class Capture:
    """Writer. Records are gathered in memory and written at most 25 ms later.

    After ``start`` threads do the writing: a busy disk may hold a write up for longer than a tick, and
    the control loop must not wait for it. What fails there is raised by the next ``flush_if_due``.

    Raises
    ------
    Aborted
        If the file cannot be made, or the disk takes no more.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE_NAME
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = TailedFile(self.path)
        except OSError as problem:
            raise Aborted(f"cannot write the raw capture {self.path}: {problem.strerror}") from None
        # A deque because appending and taking are each done at once, whichever thread is at it.
        self._pending: deque[bytes] = deque((MAGIC,))
        self._flushed_at_s = 0.0
        self._open = True
        self._writing = threading.Lock()
        self._threads: tuple[Repeating, ...] = ()
        self._failure: Aborted | None = None

    def start(self) -> None:
        """Let threads write and sync from here on."""
        self._file.expect_syncs()
        sync_folder(self.path.parent)
        self._threads = (
            Repeating("capture", self._flush_quietly, WRITE_EVERY_S),
            Repeating("capture sync", self._sync_quietly, SYNC_EVERY_S),
        )
        for thread in self._threads:
            thread.start()

    def _flush_quietly(self) -> None:
        try:
            self.flush()
        except Aborted as failure:
            self._failure = failure

    def _sync_quietly(self) -> None:
        """A disk that cannot sync cannot be written either, which the next write says."""
        if self._open:
            with contextlib.suppress(OSError):
                self._file.sync()

    def _add(self, kind: int, time_s: float, payload: bytes) -> None:
        self._pending.append(_HEAD.pack(kind, time_s, len(payload)) + payload)

    def gyro_read(self, time_s: float, data: bytes) -> None:
        """Bytes that came from the gyro, and when they were there."""
        self._add(GYRO_READ, time_s, data)

    def gyro_sent(self, time_s: float, data: bytes) -> None:
        """Bytes sent to the gyro."""
        self._add(GYRO_SENT, time_s, data)

    def can(self, time_s: float, sent: bool, frame: CanFrame) -> None:
        """A frame that crossed the bus; fits ``CanLink.record``."""
        self._add(CAN_SENT if sent else CAN_READ, time_s, pack_frame(frame))

    def tick(self, now_s: float, torque_nm: float) -> None:
        """An exchange is complete: what stands before belongs to it."""
        self._add(TICK, now_s, _TORQUE_PAYLOAD.pack(torque_nm))

    def clock(self, time_s: float) -> None:
        """What the clock said to the sequencer."""
        self._add(CLOCK, time_s, b"")

    def mark(self, time_s: float, what: str, values: Mapping[str, Any] | None = None) -> None:
        """A step in the life of the rig."""
        self._add(MARK, time_s, json.dumps({"mark": what, **(values or {})}).encode())

    def flush_if_due(self, now_s: float) -> None:
        """Write what is pending if the last time was long enough ago and no thread does it."""
        self._raise_failure()
        if self._threads:
            return
        if now_s - self._flushed_at_s >= WRITE_EVERY_S:
            self._flushed_at_s = now_s
            self.flush()

    def _raise_failure(self) -> None:
        """Raise what a thread could not write, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def require_written(self) -> None:
        """Write what is pending and raise what went wrong until now: asked before there is torque."""
        self.flush()
        self._raise_failure()

    def flush(self) -> None:
        """Write what is pending."""
        with self._writing:
            if not self._open:
                self._pending.clear()
                return
            data = b"".join(self._pending.popleft() for _ in range(len(self._pending)))
            try:
                self._file.write(data)
            except OSError as problem:
                self._open = False  # once is enough: the way out must not stumble over it again
                with contextlib.suppress(OSError):
                    self._file.close()
                raise Aborted(
                    f"the raw capture {self.path} cannot be written: {problem.strerror}. What was written until then "
                    "is kept; free space or choose another --out."
                ) from None

    def close(self) -> None:
        """Write the rest and close; safe twice. Raises Aborted where the disk did not take all and nobody was told."""
        for thread in self._threads:
            thread.stop()
        self._threads = ()
        self._raise_failure()
        if self._open:
            self.flush()
            self._sync_quietly()
            self._open = False
            with contextlib.suppress(OSError):
                self._file.close()


def read_capture(path: Path) -> Iterator[Entry]:
    """Records of a capture in order; ends quietly where the last one was cut off.

    Raises
    ------
    RecordingError
        If the file is missing or not a capture.
    """
    try:
        data = whole(path)
    except OSError as problem:
        raise RecordingError(f"cannot read the raw capture {path}: {problem.strerror}") from None
    if not data.startswith(MAGIC):
        raise RecordingError(f"{path} is not a raw capture: it does not begin with {MAGIC!r}")
    at = len(MAGIC)
    while at + _HEAD.size <= len(data):
        kind, time_s, length = _HEAD.unpack_from(data, at)
        start = at + _HEAD.size
        if kind not in KINDS or length > LONGEST_PAYLOAD or start + length > len(data):
            return
        payload = data[start : start + length]
        if not math.isfinite(time_s) or not _is_whole(kind, payload):
            return
        yield Entry(kind, time_s, payload)
        at = start + length


def _is_whole(kind: int, payload: bytes) -> bool:
    """Whether the payload is what this kind of record carries."""
    if kind in (CAN_READ, CAN_SENT):
        return _CAN_HEAD.size <= len(payload) <= _CAN_HEAD.size + LONGEST_FRAME
    if kind == TICK:
        return len(payload) == _TORQUE_PAYLOAD.size
    if kind == MARK:
        try:
            values = json.loads(payload)
        except (ValueError, RecursionError):
            return False
        return isinstance(values, dict) and isinstance(values.get("mark"), str)
    return True


def export(path: Path, prefix: str = "") -> tuple[Path, Path]:
    """Beside the capture: ``gyro.bin``, the gyro's bytes as they came, and ``can.log`` in candump's format."""
    gyro, log = path.with_name(f"{prefix}gyro.bin"), path.with_name(f"{prefix}can.log")
    with gyro.open("wb") as stream, log.open("w", encoding="ascii") as lines:
        for entry in read_capture(path):
            if entry.kind == GYRO_READ:
                stream.write(entry.payload)
            elif entry.kind in (CAN_READ, CAN_SENT):
                lines.write(_candump_line(entry))
    return gyro, log


def _candump_line(entry: Entry) -> str:
    frame = unpack_frame(entry.payload)
    identifier = f"{frame.identifier:08X}" if frame.extended else f"{frame.identifier:03X}"
    data = f"R{frame.length}" if frame.remote else frame.data.hex().upper()
    direction = "T" if entry.kind == CAN_SENT else "R"
    return f"({entry.time_s:.6f}) can0 {identifier}{'##1' if frame.fd else '#'}{data} {direction}\n"
