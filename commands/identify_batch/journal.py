"""Finished rows, kept beside the table from the moment they are there: one line of JSON each, synced, never changed."""

from __future__ import annotations

import contextlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self

from commands.identify_batch.row import COLUMNS, Row
from rig.errors import UsageError

SUFFIX = ".journal"
FORMAT = {"format": "isp-rig batch journal", "version": 1}


def journal_path(table: Path) -> Path:
    """The journal of a table: ``campaigns.parquet.journal`` beside ``campaigns.parquet``."""
    return table.with_name(table.name + SUFFIX)


class RowJournal:
    """Rows by path, the newest of each; a kill at any moment costs no row that ``append`` has returned from.

    One program at a time: a second one on the same journal is refused.

    Raises
    ------
    UsageError
        Where the file is none of ours, is in use, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows: dict[str, Row] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: BinaryIO = path.open("a+b")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}. Choose another --out.") from None
        try:
            self._lock()
            self._read()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._file.close()

    def append(self, row: Row) -> None:
        """Keep a row; it is on the disk when this returns. Raises OSError where the disk takes no more."""
        self._write(row)
        self.rows[row["path"]] = row

    def _write(self, value: object) -> None:
        self._file.write(json.dumps(value, allow_nan=False).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self) -> None:
        """Take in what is there; a last line that a kill has cut is taken off, so that the next starts a line."""
        self._file.seek(0)
        content = self._file.read()
        whole = content[: content.rfind(b"\n") + 1]
        if content and not whole and not json.dumps(FORMAT).encode().startswith(content):
            raise self._foreign()
        if len(whole) < len(content):
            self._file.truncate(len(whole))
        lines = whole.splitlines()
        if not lines:
            self._write(FORMAT)
            return
        with self._refusing_others():
            if json.loads(lines[0]) != FORMAT:
                raise ValueError
            for line in lines[1:]:
                row = json.loads(line)
                self.rows[row["path"]] = {column: row.get(column) for column in COLUMNS}

    @contextlib.contextmanager
    def _refusing_others(self) -> Iterator[None]:
        try:
            yield
        except (ValueError, KeyError, TypeError, AttributeError):
            raise self._foreign() from None

    def _foreign(self) -> UsageError:
        return UsageError(
            f"{self.path}: is damaged, or no journal of identify-batch: move it away, or choose another --out"
        )

    def _lock(self) -> None:
        try:
            if sys.platform == "win32":
                import msvcrt

                self._file.seek(1 << 30)  # a byte beyond all rows: on Windows a lock keeps others from reading it
                msvcrt.locking(self._file.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                import fcntl

                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise UsageError(
                f"{self.path}: another identify-batch is writing this table: wait for it, or choose another --out"
            ) from None
