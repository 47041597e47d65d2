"""`rig recover`: repairs a results folder after a kill or a power cut, so that it can be identified from."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from commands.terminal.display import counted, plain
from commands.terminal.exit_codes import OK
from rig.errors import Aborted, RecordingError, RigError

if TYPE_CHECKING:
    from rig.recording.recover import Recovery

CONFIG_FILE = "recovered.yaml"
CAPTURE_FILE = "wire.cap"
RESULT_FILE = "result.json"


def recover_folder(folder: Path) -> int:
    """Mend ``folder`` and say on stdout what was found; returns the exit code. Raises RecordingError."""
    from rig.recording.recover import recover

    if not folder.is_dir():
        raise RecordingError(f"{folder}: is not a folder: give the results folder of a campaign")
    for line in _captures(folder):
        sys.stdout.write(plain(line) + "\n")
    try:
        recovery = recover(folder)
    except RecordingError as error:
        recovery = _out_of_captures(folder, error)
    for line in recovery.lines:
        sys.stdout.write(plain(line) + "\n")
    if not (folder / RESULT_FILE).exists():
        sys.stdout.write(f"{RESULT_FILE}: missing: the campaign ended before the identification\n")
    if not recovery.is_new:
        sys.stdout.write(f"Nothing to recover: {plain(str(recovery.export))} is complete.\n")
        return OK
    config = _write_config(folder, recovery.export, recovery.recording.info)
    sys.stdout.write(
        f"Recovered: {plain(str(recovery.export))}\n"
        f"To identify the parameters from it, run: identify-run {plain(str(config))}\n"
    )
    return OK


def _captures(folder: Path) -> Iterator[str]:
    """A line for every raw capture; what a campaign writes beside it at its end is written where it is missing."""
    from drivers.capture.account import export_if_missing, summary_of

    for path in _capture_files(folder):
        name = path.relative_to(folder)
        try:
            account = summary_of(path)
        except RecordingError as error:
            yield f"{name}: lost: {error}"
            continue
        yield f"{name}: {account}"
        for written in export_if_missing(path, account):
            yield f"{written.relative_to(folder)}: written"


def _out_of_captures(folder: Path, without: RecordingError) -> Recovery:
    """Where no journal has a sample: what the drivers make of the raw captures. Raises RecordingError."""
    from drivers.capture.account import summary_of
    from drivers.replay.recording import recording_from_capture
    from rig.recording.hdf5 import write_recording_h5
    from rig.recording.recover import Recovery
    from rig.recording.results import RECORDING_FILE, RECOVERED_FILE, free_name

    paths = _capture_files(folder)
    if not paths:
        raise without
    recordings, lines = [], ["no journal holds a sample: the raw capture is decoded by the drivers instead"]
    for path in paths:
        name = path.relative_to(folder)
        try:
            if summary_of(path).ticks:
                recordings.append(recording_from_capture(path))
            else:
                lines.append(f"{name}: ends before the first set")
        except Aborted:
            raise
        except RigError as error:
            lines.append(f"{name}: no set could be recovered from it: {str(error).removeprefix(f'{path} ')}")
    if not recordings:
        raise RecordingError("; ".join((str(without), *lines[1:])))
    runs = [run for recording in recordings for run in recording.runs]
    runs = [dataclasses.replace(run, name=f"set {n}") for n, run in enumerate(runs, 1)]
    info = dict(recordings[0].info) | {"recovered": True, "aborted": "recovered from the raw capture alone"}
    recording = dataclasses.replace(recordings[0], runs=tuple(runs), info=info)
    lines += [f"  {run.name}: {len(run.time_s)} samples over {run.duration_s:.3f} s" for run in runs]
    there = (folder / RECORDING_FILE).exists()
    path = free_name(folder, RECOVERED_FILE if there else RECORDING_FILE)
    write_recording_h5(path, recording)
    lines.append(
        f"{path.name}: written, {counted(len(runs), 'run')}; the names of the sets were in the journal and are lost"
    )
    return Recovery(tuple(lines), recording, path, is_new=True)


def _capture_files(folder: Path) -> list[Path]:
    """That of the campaign first, then those of its follow-ups."""
    return sorted(folder.glob(f"raw/**/{CAPTURE_FILE}"), key=lambda path: (len(path.parts), path))


def _write_config(folder: Path, export: Path, info: Mapping[str, Any]) -> Path:
    """A configuration that reads what was recovered, with the model that was declared."""
    from rig.recording.results import free_name

    content: dict[str, Any] = {"backend": "recorded", "recorded": {"runs": [{"file": export.name}]}}
    config = info.get("config")
    model = config.get("model") if isinstance(config, dict) else None
    head = "# Reads the recovered recording; the model is the declared one.\n"
    if isinstance(model, dict):
        content["model"] = dict(model)
        if content["model"].pop("effects_from", None):
            # A recording comes from anywhere; a file of effects is code, and only a person may name that.
            content["model"].pop("effects", None)
            head += (
                "# The campaign read effects from a file. If you trust that file, name it under model.effects_from.\n"
            )
    else:
        head = "# Reads the recovered recording. The declared model was lost: add it as model: before you identify.\n"
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
    path = free_name(folder, CONFIG_FILE)
    path.write_text(head + text, encoding="utf-8")
    return path
