"""After the last tick: journals and the log of the sequencer become recording.h5."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from commands.campaign.campaign_part import CampaignPart, PlayedCampaign
from commands.campaign.context import CommandContext
from commands.campaign.provenance import provenance
from commands.campaign.results_folder import RECORDING_FILE, ResultsFolder
from rig.config.load import LoadedConfig
from rig.errors import RigError
from rig.recording.hdf5 import write_recording_h5
from rig.recording.journal import JournalError
from rig.recording.journal_reader import JournalContents, read_journal, recording_from_journal
from rig.recording.results import joined
from rig.recording.run import Recording
from rig.sequencer.recorder import SetStatistics

WIRE_LOGS = ("gyro.bin", "can.log")  # beside a raw capture; empty where no device could be reached


def save(
    context: CommandContext,
    path: Path,
    recording: Recording | None,
    info: Mapping[str, Any],
    played: PlayedCampaign,
    part: CampaignPart,
) -> PlayedCampaign:
    """Write recording.h5; a disk that takes no more is said, and the journals have the samples."""
    earlier = part.earlier
    contents = _read_back(context, path / played.journals[0])
    if recording is None:
        recording = recording_from_journal(contents) if contents is not None else Recording(())
    recording = dataclasses.replace(recording, info=dict(info))
    if earlier is not None:
        before = [_read_back(context, path / name) for name in earlier.journals]
        contents = joined([c for c in (*before, contents) if c is not None])
        if part.resumes is None:
            recording = _added(earlier.recording, recording, part.listed)
        else:
            recording = _resumed(earlier.recording, recording)
        played = dataclasses.replace(
            played, completed=played.completed | earlier.completed, journals=(*earlier.journals, *played.journals)
        )
    if recording.runs:
        try:
            _write(path, recording, contents, anew=(path / RECORDING_FILE).exists())
        except RigError as problem:
            context.say_error(problem)
    return dataclasses.replace(played, recording=recording, read_back=contents is not None)


def describe_location(played: PlayedCampaign, folder: Path) -> str:
    """Where the samples of a campaign are, or that there are none and what its folder has instead."""
    if played.recording.runs:
        return f"The recording is in {folder}"
    if not played.read_back:
        return (
            f"The recording could not be read back. The data on disk are in {folder}: recover them with `rig recover`"
        )
    wire = any(path.stat().st_size for path in folder.glob("raw/**/*.*") if path.name in WIRE_LOGS)
    kept = "the raw capture of the wire, and the journal" if wire else "the journal"
    return (
        f"Nothing was recorded: the campaign ended before the first sample of a set. {folder} holds {kept}, which "
        "shows why"
    )


def _write(path: Path, recording: Recording, contents: JournalContents | None, anew: bool) -> None:
    """Write recording.h5; with ``anew`` the one that stands there gives way only to a whole one that has it all."""
    if not anew:
        write_recording_h5(path / RECORDING_FILE, recording, contents)
        return
    new = path / f"{RECORDING_FILE}.new"
    write_recording_h5(new, recording, contents)
    try:
        new.replace(path / RECORDING_FILE)
    except OSError as error:
        raise JournalError(f"cannot write {path / RECORDING_FILE}: {error.strerror}; all data are in {new}") from error


def _read_back(context: CommandContext, path: Path) -> JournalContents | None:
    try:
        return read_journal(path)
    except RigError as problem:
        context.say_error(problem)
        return None


def _added(earlier: Recording, new: Recording, listed: str) -> Recording:
    """All runs of a campaign; what is said of the new part stands behind what was said of the first."""
    info = dict(earlier.info)
    info[listed] = [*info.get(listed, ()), dict(new.info)]
    return dataclasses.replace(earlier, runs=(*earlier.runs, *new.runs), info=info)


def _resumed(earlier: Recording, new: Recording) -> Recording:
    """The finished runs of before and those of now; what is said is of now, and names the folder of before."""
    return dataclasses.replace(new, runs=(*earlier.runs, *new.runs))


def export_earlier(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, part: CampaignPart, header: Mapping[str, Any]
) -> PlayedCampaign:
    """Make a folder of what was played before, where nothing is left to play."""
    path = folder.create()
    part.copy_journals(path)
    assert part.earlier is not None
    info = dict(header) | provenance(loaded) | {"resumed_from": str(part.resumes), "aborted": None}
    contents = joined([c for _, name in part.copied_journals if (c := _read_back(context, path / name)) is not None])
    recording = dataclasses.replace(part.earlier.recording, info=info, noise=header.get("noise"))
    with context.stops.saving():
        write_recording_h5(path / RECORDING_FILE, recording, contents)
    return dataclasses.replace(part.earlier, recording=recording)


def figures(statistics: SetStatistics) -> dict[str, Any]:
    """How a set went, in numbers."""
    late_ms = {
        f"late_ms_p{q:g}": statistics.late.quantile_s(q / 100) * 1e3 if statistics.late.ticks else None
        for q in (50, 99, 99.9, 100)
    }
    return {
        "name": statistics.name,
        "complete": statistics.complete,
        "missed_ticks": statistics.missed_ticks,
        "invalid_samples": statistics.drops,
        "peak_torque_nm": statistics.peak_torque_nm,
    } | late_ms
