"""The raw journal of a results folder, also of a campaign that was cut short."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.journal_reader import read_journal, recording_from_journal
from rig.recording.run import Run


def read(path: Path) -> Sequence[Run]:
    """Every run that has samples. Raises RecordingError where there is none."""
    contents = read_journal(path)
    try:
        runs = recording_from_journal(contents).runs
    except (KeyError, TypeError, ValueError) as error:
        raise RecordingError(
            f"{path}: its frames are sound but not what this version writes ({error!r}): "
            "read it with the version that wrote it"
        ) from error
    if not runs:
        raise RecordingError(f"{path}: no run in it has a sample: the campaign stopped before it moved; play it again")
    return runs
