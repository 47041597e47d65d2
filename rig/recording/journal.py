"""The raw journal: an append-only file written while a campaign plays.

A kill costs at most what was buffered since the last write (25 ms by default), a power cut what was written since
the last sync (40 ms more, and as long as the disk takes). Whatever was written stays readable, because every frame
carries its own length and CRC; docs/recordings.md has the format and what is lost when.

    frame  = marker "ISPJ", type, 3 zero bytes, payload length, CRC-32 of all the rest    (little-endian)
    HEADER = JSON   RUN = JSON {name, meta, columns}   BLOCK = kind (16 bytes ASCII), columns, float64 rows
    EVENT  = JSON {time_s, text, values}   RUN_END = JSON {complete}   CLOSE = empty
"""

from __future__ import annotations

import contextlib
import json
import struct
import threading
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rig.errors import Aborted
from rig.recording.flushing import SYNC_EVERY_S, WRITE_EVERY_S, Repeating, sync_folder
from rig.recording.tail_file import TailedFile

MARKER = b"ISPJ"
FRAME_HEAD = struct.Struct("<4sB3xII")
BLOCK_HEAD = struct.Struct("<16sI")
HEADER, RUN, BLOCK, EVENT, RUN_END, CLOSE = range(1, 7)
DEFAULT_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "samples": ("time_s", "rate_rad_s", "valid"),
    "commands": ("time_s", "torque_nm", "torque_commanded_nm"),
}
MAX_FRAME_BYTES = 64 * 1024 * 1024


class JournalError(Aborted):
    """The journal can no longer be written (disk full, folder gone): the campaign ends as by Ctrl-C."""


def frame(kind: int, payload: bytes) -> bytes:
    """One framed record, ready to be appended."""
    crc = zlib.crc32(payload, zlib.crc32(struct.pack("<BI", kind, len(payload))))
    return FRAME_HEAD.pack(MARKER, kind, len(payload), crc) + payload


def _json(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, default=str).encode()


class Journal:
    """Writer of one journal. Cheap to call from a control loop: rows are buffered, then written as a block.

    Without ``flushing_in_background`` the call that finds the flush interval over does the writing; with
    it, a thread writes and forces the data to the disk, and the control loop never waits for either.
    """

    def __init__(self, file: TailedFile, flush_interval_s: float, clock: Callable[[], float]) -> None:
        self.path = file.path
        self._file = file
        self._interval_s = flush_interval_s
        self._clock = clock
        self._flushed_at_s = clock()
        self._rows: dict[str, list[np.ndarray]] = {}
        self._pending: list[bytes] = []  # frames complete but not yet on disk
        self._columns: dict[str, tuple[str, ...]] = {}
        self._in_run = False
        self._closed = False
        self._failure: JournalError | None = None
        self._background = False
        self._buffer_lock = threading.Lock()
        self._file_lock = threading.Lock()

    @classmethod
    def create(
        cls,
        path: str | Path,
        header: Mapping[str, Any],
        *,
        flush_interval_s: float = WRITE_EVERY_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> Journal:
        """Start a new journal; an existing file is never overwritten.

        ``header`` is stored as JSON: ``axis``, ``noise``, ``config_text``, ``versions`` and what else is
        worth keeping. Raises JournalError where the file cannot be made.
        """
        path = Path(path)
        try:
            file = TailedFile(path)
        except OSError as error:
            raise JournalError(f"cannot start journal {path}: {error.strerror}; choose another --out") from error
        journal = cls(file, flush_interval_s, clock)
        journal._pending.append(frame(HEADER, _json({"format": "isp-rig journal", "version": 1} | dict(header))))
        journal.flush(to_disk=True)
        sync_folder(path.parent)
        return journal

    def begin_run(
        self, name: str, meta: Mapping[str, Any], columns: Mapping[str, tuple[str, ...]] | None = None
    ) -> None:
        """Open a run. ``columns`` adds or replaces kinds beside ``DEFAULT_COLUMNS`` (say, an ``angle_rad``
        among the samples or a ``clocks`` kind). ``meta`` may hold what Run holds: ``use``, ``torque_hold``,
        ``frequency_hz``, ``min_rate_rad_s``, ``added_inertia_kg_m2``."""
        if self._in_run:
            raise ValueError("end_run() before the next begin_run()")
        self._columns = {**DEFAULT_COLUMNS, **{k: tuple(v) for k, v in (columns or {}).items()}}
        self._in_run = True
        self._queue(frame(RUN, _json({"name": name, "meta": dict(meta), "columns": self._columns})))
        self._flush_unless_in_background()

    def append(self, kind: str, rows: ArrayLike) -> None:
        """Add one row, shape (columns,), or several, shape (n, columns), of ``kind`` to the open run.

        Raises JournalError once an earlier write has failed.
        """
        block = np.array(rows, dtype="<f8", ndmin=2)
        if not self._in_run:
            raise ValueError("append() outside of a run")
        if kind not in self._columns or block.ndim != 2 or block.shape[1] != len(self._columns[kind]):
            raise ValueError(f"{kind}: rows of shape {block.shape} do not fit columns {self._columns.get(kind)}")
        self._raise_failure()
        with self._buffer_lock:
            self._rows.setdefault(kind, []).append(block)
        self._flush_if_due()

    def event(self, time_s: float, text: str, values: Mapping[str, Any] | None = None) -> None:
        """Note something that happened, in or between runs."""
        self._queue(frame(EVENT, _json({"time_s": float(time_s), "text": text, "values": dict(values or {})})))
        self._flush_if_due()

    def end_run(self, complete: bool = True) -> None:
        """Close the open run and write it out (a flush later, where that is done in the background).

        ``complete`` is False for a run that was cut short: a campaign that is resumed plays it again.
        """
        if not self._in_run:
            raise ValueError("end_run() without begin_run()")
        self._in_run = False
        self._queue(frame(RUN_END, _json({"complete": complete})))
        self._flush_unless_in_background()

    def _flush_unless_in_background(self) -> None:
        """A set begins and ends within the control loop, which must not wait for a disk that is busy."""
        if self._background:
            self._raise_failure()
        else:
            self.flush()

    def flush(self, *, to_disk: bool = False) -> None:
        """Write all that is buffered; ``to_disk`` also survives a power cut.

        Raises JournalError; what could not be written stays buffered and is tried again.
        """
        with self._file_lock:
            with self._buffer_lock:
                self._seal_rows()
                data = b"".join(self._pending)
                taken = len(self._pending)
            try:
                self._file.write(data)
                if to_disk:
                    self._file.sync()
            except OSError as error:
                self._failure = self._failed(error)
                raise self._failure from error
            with self._buffer_lock:
                del self._pending[:taken]
            self._failure = None
        self._flushed_at_s = self._clock()

    def _failed(self, error: OSError) -> JournalError:
        return JournalError(
            f"cannot write {self.path}: {error.strerror}. What was recorded until now "
            f"({self._file.written} bytes) is kept there; free space or choose another --out, "
            "then play again"
        )

    def close(self) -> None:
        """Write the rest and close. Raises JournalError unless the same failure was raised before."""
        if self._closed:
            return
        self._closed = True
        reported = self._failure is not None
        if self._in_run:
            self.end_run_quietly()
        self._queue_raw(frame(CLOSE, b""))
        try:
            self.flush(to_disk=True)
        except JournalError:
            if not reported:
                raise
        finally:
            self._close_file(quietly=reported)

    def _close_file(self, quietly: bool) -> None:
        try:
            self._file.close()
        except OSError as error:
            if not quietly:
                raise self._failed(error) from error

    def end_run_quietly(self) -> None:
        """Mark the open run as ended without writing yet: the last step of an aborted campaign."""
        self._in_run = False
        self._queue_raw(frame(RUN_END, _json({"complete": False})))

    @contextmanager
    def flushing_in_background(self) -> Iterator[None]:
        """Let threads write and sync; a failure of theirs is raised by the next call here.

        Two of them, and a file that takes what comes during a sync: a disk that takes its time to sync must not hold
        up what a mere kill would cost.
        """
        threads = (
            Repeating("journal", self._flush_quietly, self._interval_s),
            Repeating("journal sync", self._sync_quietly, SYNC_EVERY_S),
        )
        self._background = True
        self._file.expect_syncs()
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            for thread in threads:
                thread.stop()
            self._background = False

    def _flush_quietly(self) -> None:
        with contextlib.suppress(JournalError):  # kept in self._failure: the loop meets it at its next append
            self.flush()

    def _sync_quietly(self) -> None:
        try:
            self._file.sync()
        except OSError as error:
            self._failure = self._failed(error)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _queue(self, data: bytes) -> None:
        self._raise_failure()
        self._queue_raw(data)

    def _queue_raw(self, data: bytes) -> None:
        with self._buffer_lock:
            self._seal_rows()  # rows of this run stay ahead of its end
            self._pending.append(data)

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _flush_if_due(self) -> None:
        if not self._background and self._clock() - self._flushed_at_s >= self._interval_s:
            self.flush()

    def _seal_rows(self) -> None:
        for kind, blocks in self._rows.items():
            rows = np.concatenate(blocks)
            step = max(1, (MAX_FRAME_BYTES // 2) // (8 * rows.shape[1]))
            for start in range(0, len(rows), step):
                part = np.ascontiguousarray(rows[start : start + step])
                head = BLOCK_HEAD.pack(kind.encode("ascii"), part.shape[1])
                self._pending.append(frame(BLOCK, head + part.tobytes()))
        self._rows.clear()
