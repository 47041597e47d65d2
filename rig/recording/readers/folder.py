"""A results folder: its recording.h5, else what was recovered, else its raw journals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.results import RECORDING_FILE, RECOVERED_FILE, journals_of
from rig.recording.run import Run

ROS_METADATA = "metadata.yaml"


def is_ros_bag(folder: Path) -> bool:
    """Whether a folder is a bag of ROS 2."""
    return (folder / ROS_METADATA).is_file() and any(file.suffix in (".db3", ".mcap") for file in folder.iterdir())


def read(path: Path) -> Sequence[Run]:
    """Every run of the campaign. Raises RecordingError where the folder holds none that can be read."""
    from rig.recording.hdf5 import read_recording_h5  # noqa: PLC0415  slow to import
    from rig.recording.readers import raw_journal  # noqa: PLC0415

    wrong: list[str] = []
    recovered = sorted(path.glob(f"{Path(RECOVERED_FILE).stem}*.h5"), reverse=True)
    for file in (path / RECORDING_FILE, *recovered):
        try:
            if file.is_file() and (runs := read_recording_h5(file, with_info=False).runs):
                return runs
        except RecordingError as error:
            wrong.append(str(error))
    found: list[Run] = []
    for journal in journals_of(path):
        try:
            found += raw_journal.read(journal) if journal.is_file() else ()
        except RecordingError as error:
            wrong.append(str(error))
    if found:
        return found
    faults = "\n".join(wrong) or f"it has neither {RECORDING_FILE} nor a .journal"
    raise RecordingError(
        f"{path}: is a folder without a recording that can be read: {faults}; name one file "
        "of it for each run, or a results folder"
    )
