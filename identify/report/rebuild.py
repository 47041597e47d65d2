"""report.html made again from what stands in a results folder."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from identify.report.files import result_json
from identify.report.own_effects import make_effects_known
from identify.report.page import report_html
from identify.report.read_result import RESULT, read_result
from identify.report.replaced_file import replace_file
from identify.report.report_data import FILE, ReportData, read_report_data
from identify.results import Identification
from rig.errors import RecordingError, UsageError
from rig.recording.hdf5 import read_recording_h5
from rig.recording.run import Recording

RECORDING, REPORT = "recording.h5", "report.html"


def rebuild_report(folder: Path, effect_files: Sequence[Path] = ()) -> Path:
    """Write report.html of a results folder anew; the old one stays until the new one is complete.

    ``effect_files`` are those of effects of your own, whose code is run. Returns the path of the report.

    Raises
    ------
    UsageError
        Where something is missing, damaged or of another version, or the report cannot be written.
    """
    for file, cure in (
        (RESULT, "nothing was identified in it; `rig recover` says what was recorded"),
        (FILE, f"it was written by an earlier version or for more samples than are kept, {_again(folder)}"),
        (RECORDING, "restore it from a copy: the report shows its origin and its frequency response"),
    ):
        if not (folder / file).is_file():
            raise RecordingError(f"{folder}: has no {file}: {cure}. The report is left as it is")
    result, data = read_result(folder / RESULT), read_report_data(folder / FILE)
    _check_same(folder, result, data.identification)
    make_effects_known(data, effect_files)
    recording = _identified_from(folder / RECORDING, data)
    page = report_html(data.identification, recording, data.name)
    try:
        return replace_file(folder / REPORT, page)
    except OSError as error:
        raise UsageError(
            f"cannot write {folder / REPORT}: {error.strerror}. The old report is left as it was"
        ) from error


def _again(folder: Path) -> str:
    return f"so identify again from its recording (recorded.runs: [{{file: {folder}}}])"


def _check_same(folder: Path, result: dict[str, Any], identification: Identification) -> None:
    """Raises RecordingError where the numbers of result.json are not those of the report data."""
    own = json.loads(json.dumps(result_json(identification)))
    if any(result.get(key) != own[key] for key in ("accepted", "aborted", "axis")) or any(
        _numbers(result.get(model)) != _numbers(own[model]) for model in ("before", "after")
    ):
        raise RecordingError(
            f"{folder}: {RESULT} and {FILE} do not hold the same numbers: one of them was changed or comes from "
            "another folder. Restore the pair"
        )


def _numbers(model: Any) -> Any:
    return [model.get(key) for key in ("parameters", "effect_parameters")] if isinstance(model, dict) else model


def _identified_from(path: Path, data: ReportData) -> Recording:
    recording = read_recording_h5(path)
    runs = {run.name: run for run in recording.runs}
    absent = [name for name in data.runs if name not in runs]
    if absent:
        raise RecordingError(
            f"{path}: has no run {absent[0]!r}, from which {FILE} was identified: restore the recording"
        )
    return dataclasses.replace(recording, runs=tuple(runs[name] for name in data.runs))
