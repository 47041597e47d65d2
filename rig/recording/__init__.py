"""Recordings: what was played and measured, however it came about."""

from rig.recording.journal import Journal, JournalError
from rig.recording.journal_reader import JournalContents, read_journal, recording_from_journal
from rig.recording.run import Recording, Run

__all__ = [
    "Journal",
    "JournalContents",
    "JournalError",
    "Recording",
    "Run",
    "read_journal",
    "recording_from_journal",
]
