"""The results folder: named before playing, created after the pre-flight, never overwritten."""

from __future__ import annotations

import errno
import shutil
from datetime import UTC, datetime
from pathlib import Path

from commands.terminal.exit_codes import as_rig_error
from rig.errors import UsageError

RUNS = Path("runs")
JOURNAL_FILE = "recording.journal"
RECORDING_FILE = "recording.h5"
RAW_FOLDER = "raw"
DISK_FULL_ERRNOS = (errno.ENOSPC, errno.EDQUOT)
MAX_FOLDERS_A_SECOND = 1000  # campaigns of one name that begin within a second


class ResultsFolder:
    """Where the results will be.

    Parameters
    ----------
    out
        As given with --out, or None for ``runs/<UTC time>-<name>``.
    name
        The campaign's.
    now
        With its time zone.

    Raises
    ------
    UsageError
        If ``out`` exists.
    """

    def __init__(self, out: Path | None, name: str, now: datetime) -> None:
        self.is_created = False
        self.path = out if out is not None else _free(RUNS / f"{now.astimezone(UTC):%Y%m%dT%H%M%SZ}-{name}")
        if self.path.exists() or self.path.is_symlink():
            raise UsageError(f"--out {self.path} exists and is never overwritten: choose another folder.")

    def create(self) -> Path:
        """Make the folder, once, and return its path.

        Raises UsageError where it cannot be made, Aborted where that is because the disk is full.
        """
        if not self.is_created:
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                self.path.mkdir()
            except OSError as problem:
                if problem.errno in DISK_FULL_ERRNOS:
                    raise as_rig_error(problem) from None
                raise self._cannot(problem) from None
            self.is_created = True
        return self.path

    def _cannot(self, problem: OSError) -> UsageError:
        return UsageError(
            f"cannot make the results folder {self.path}: {problem.strerror} ({problem.filename}). "
            "Choose another with --out."
        )

    def discard(self) -> None:
        """Take back a folder in which nothing was recorded, because nothing was played."""
        if self.is_created:
            shutil.rmtree(self.path, ignore_errors=True)
            self.is_created = False

    def existing_path(self) -> Path | None:
        """The folder as far as there is one."""
        return self.path if self.is_created else None


def _free(path: Path) -> Path:
    """``path``, or the same with the first number behind it that is free."""
    numbered = (path.with_name(f"{path.name}-{n}") for n in range(2, MAX_FOLDERS_A_SECOND))
    return next((p for p in (path, *numbered) if not p.exists()), path)
