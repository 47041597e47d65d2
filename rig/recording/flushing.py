"""Periodic writing and syncing to disk, in threads of their own: the control loop must never wait for a disk."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

WRITE_EVERY_S = 0.025
SYNC_EVERY_S = 0.04
"""A kill loses what is not yet written; a power cut loses what is not yet synced as well."""


class Repeating:
    """A thread that calls ``work`` every ``every_s`` until it is stopped; what ``work`` raises ends it."""

    def __init__(self, name: str, work: Callable[[], None], every_s: float) -> None:
        self._work, self._every_s = work, every_s
        self._enough = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Let the work that is under way come to its end, and no further one begin."""
        self._enough.set()
        self._thread.join()

    def _run(self) -> None:
        due_s = time.monotonic() + self._every_s
        while not self._enough.wait(max(0.0, due_s - time.monotonic())):
            self._work()
            due_s = max(due_s + self._every_s, time.monotonic())  # no burst after a disk that was slow


def sync(descriptor: int) -> None:
    """See to it that what was written survives a power cut. Raises OSError."""
    # The size is brought to the disk by both; the times of the file may wait.
    getattr(os, "fdatasync", os.fsync)(descriptor)


def sync_folder(folder: Path) -> None:
    """The same for the name of a file that was just made there; where the system has no such thing, nothing."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError:
        pass  # some network file systems refuse; the file itself is synced all the same
    finally:
        os.close(descriptor)
