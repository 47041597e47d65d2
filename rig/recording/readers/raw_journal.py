"""The raw journal of a results folder, also of a campaign that was cut short."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.checks import MIN_VALID_SAMPLES
from rig.recording.journal_reader import JournalRun, read_journal, run_from_journal
from rig.recording.run import Run


def read(path: Path) -> Sequence[Run]:
    """Every run that tells anything. Raises RecordingError where there is none."""
    contents = read_journal(path)
    try:
        runs = [run_from_journal(run) for run in contents.runs if is_worth_reading(run)]
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise RecordingError(
            f"{path}: its frames are intact but not in the format of this version ({error!r}): "
            "read it with the version that wrote it"
        ) from error
    if not runs:
        raise RecordingError(f"{path}: no run in it has a sample: the campaign stopped before it moved; play it again")
    return runs


def is_worth_reading(run: JournalRun) -> bool:
    """Whether a run is worth reading: one that was cut in its first milliseconds must not spoil those before it.

    A whole run is always read, so that what is wrong with it is said.
    """
    samples = len(run.tables.get("samples", ()))
    if run.complete or run.ended:
        return samples > 0
    return samples >= MIN_VALID_SAMPLES and len(run.tables.get("commands", ())) > 0
