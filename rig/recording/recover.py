"""Recovery of a results folder after a kill or a power cut; existing files are not changed.

The journals have everything that was written; recording.h5 is made of them at the end of a campaign, and is made
here where it is absent, damaged or has less.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.hdf5 import read_recording_h5, write_recording_h5
from rig.recording.journal_reader import JournalContents, JournalRun, read_journal, recording_from_journal
from rig.recording.results import RECORDING_FILE, RECOVERED_FILE, free_name, joined, journals_of
from rig.recording.run import Recording

UNWRITTEN_S = 0.1  # a kill costs less than this, a power cut hardly more; see docs/recordings.md


@dataclass(frozen=True)
class Recovery:
    """What was found in a folder.

    ``lines`` say it for people; ``export`` is the file that was written, or the recording.h5 that was whole.
    """

    lines: tuple[str, ...]
    recording: Recording
    export: Path
    is_new: bool


def recover(folder: Path) -> Recovery:
    """Read what there is in a results folder, and export it where its recording.h5 is not whole.

    Raises RecordingError where no journal can be read and recording.h5 neither; JournalError where the disk is full.
    """
    lines: list[str] = []
    parts = _read_all(journals_of(folder), lines)
    contents = joined(parts)
    recording = _recording_of(contents, lines) if contents is not None else Recording(())
    state, whole = _state_of_export(folder / RECORDING_FILE, recording)
    lines.append(f"{RECORDING_FILE}: {state}")
    lines += [f"{part.name}: incomplete, left unchanged" for part in sorted(folder.glob("*.part"))]
    if whole is not None:
        return Recovery(tuple(lines), whole, folder / RECORDING_FILE, is_new=False)
    if contents is None or not recording.runs:
        details = "; ".join(lines)
        raise RecordingError(f"{folder}: nothing can be recovered: no journal with a sample in it ({details})")
    name = RECORDING_FILE if state == "absent" else RECOVERED_FILE
    path = free_name(folder, name)
    write_recording_h5(path, recording, contents)
    lines.append(f"{path.name}: written, {len(recording.runs)} run(s)")
    return Recovery(tuple(lines), recording, path, is_new=True)


def _read_all(journals: Sequence[Path], lines: list[str]) -> list[JournalContents]:
    parts = []
    for path in journals:
        try:
            contents = read_journal(path)
        except RecordingError as error:
            lines.append(f"{path.name}: lost: {error}")
            continue
        parts.append(contents)
        lines.append(f"{path.name}: {_account(contents)}")
        lines += [f"  {_line(run)}" for run in contents.runs]
        lines += [f"  said: {event.text}" for event in contents.events if dict(event.values).get("aborted")]
        lines += _never_played(contents)
    if not journals:
        lines.append("no .journal: what was not exported is lost")
    return parts


def _account(contents: JournalContents) -> str:
    if contents.closed and not contents.unread_bytes:
        return "complete, closed normally"
    notes = [] if contents.closed else [f"the program was killed: up to {UNWRITTEN_S:g} s before that were not written"]
    if contents.gaps:
        notes.append(
            f"{contents.gaps} damaged part(s); {contents.stray_rows} row(s) after them belong to no known run and are "
            "left out"
        )
    if contents.unread_bytes:
        notes.append(f"{contents.unread_bytes} byte(s) lost: cut or damaged")
    return "; ".join(notes)


def _line(run: JournalRun) -> str:
    samples = run.tables["samples"]
    column = run.columns["samples"].index("time_s")
    until_s = float(samples[-1, column]) if len(samples) else 0.0
    how = "whole" if run.complete else "ended" if run.ended else "CUT SHORT"
    return f"{run.name}: {how}, {len(samples)} samples to {until_s:.3f} s"


def _never_played(contents: JournalContents) -> list[str]:
    planned = contents.header.get("planned")
    names = [str(name) for name in planned] if isinstance(planned, list) else []
    begun = {run.name for run in contents.runs}
    missing = [name for name in names if name not in begun]
    return [f"  never played: {', '.join(missing)}"] if missing else []


def _recording_of(contents: JournalContents, lines: list[str]) -> Recording:
    """All runs that have samples, each with a name of its own; a run that is nonsense is said and left out."""
    runs, taken = [], set()
    for source in contents.runs:
        single = dataclasses.replace(contents, runs=(source,))
        try:
            found = recording_from_journal(single).runs
        except (KeyError, TypeError, ValueError, IndexError) as error:
            lines.append(
                f"  {source.name}: not recovered: its frames are intact but not in the format of this version "
                f"({error!r})"
            )
            continue
        for run in found:
            name, n = run.name, 2
            while name in taken:
                name, n = f"{run.name} ({n})", n + 1
            taken.add(name)
            runs.append(dataclasses.replace(run, name=name))
    recording = recording_from_journal(dataclasses.replace(contents, runs=()))
    info = {"recovered": True, "aborted": "recovered from the raw journal: the campaign did not end normally"}
    return dataclasses.replace(recording, runs=tuple(runs), info=dict(recording.info) | info)


def _state_of_export(path: Path, expected: Recording) -> tuple[str, Recording | None]:
    """What there is to say of recording.h5, and what it holds where it is whole."""
    if not path.exists():
        return "absent", None
    try:
        found = read_recording_h5(path)
    except RecordingError as error:
        return f"damaged ({error})", None
    here, wanted = _samples(found), _samples(expected)
    if here < wanted:
        return f"has {here} samples where the journals have {wanted}", None
    return f"complete, {len(found.runs)} run(s), {here} samples", found


def _samples(recording: Recording) -> int:
    return sum(len(run.time_s) for run in recording.runs)
