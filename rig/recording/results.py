"""Where the recordings of a results folder are, and several journals of one campaign as one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.journal_reader import JournalContents

RECORDING_FILE = "recording.h5"
RECOVERED_FILE = "recovered.h5"
JOURNAL_FILE = "recording.journal"
EARLIER_JOURNAL = "earlier_{}.journal"
MAX_FILES = 1000


def journals_of(folder: Path) -> list[Path]:
    """The journals in the order in which they were played: those resumed, the campaign's own, its follow-ups."""
    return sorted(folder.glob("*.journal"), key=_order)


def campaign_journals(folder: Path) -> list[Path]:
    """The same without follow-ups, which no resuming takes up again."""
    return [path for path in journals_of(folder) if _order(path)[0] < 2]


def _order(path: Path) -> tuple[int, int, str]:
    number = int(found.group()) if (found := re.search(r"\d+", path.stem)) and len(found.group()) < 9 else 0
    kind = 1 if path.name == JOURNAL_FILE else 0 if path.stem.startswith("earlier_") else 2
    return kind, number, path.name


def free_name(folder: Path, name: str) -> Path:
    """``name`` in ``folder``, or the same with the first number that is free: nothing is overwritten.

    Raises RecordingError where a thousand are taken.
    """
    path = folder / name
    numbered = (path.with_stem(f"{path.stem}_{n}") for n in range(2, MAX_FILES))
    for candidate in (path, *numbered):
        if not candidate.exists() and not candidate.is_symlink():
            return candidate
    raise RecordingError(f"{path}: too many numbered copies exist already: move some to another folder")


def joined(parts: Sequence[JournalContents]) -> JournalContents | None:
    """Journals of one campaign as one, in the order they were played; None of none."""
    if not parts:
        return None
    return JournalContents(
        parts[0].header,
        tuple(run for part in parts for run in part.runs),
        tuple(event for part in parts for event in part.events),
        all(part.closed for part in parts),
        sum(part.unread_bytes for part in parts),
        sum(part.gaps for part in parts),
        sum(part.stray_rows for part in parts),
    )
