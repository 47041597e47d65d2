"""What a worker does: read one campaign, identify it as `identify-run` would, return its row."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commands.identify_batch.campaigns import RECORDING_FILE, Job, inputs_of, keeps_apart
from commands.identify_batch.row import Row, failed_row, row_of
from commands.terminal.version import version
from rig.errors import ConfigError, RecordingError, RigError

if TYPE_CHECKING:
    from identify.results import Identification
    from rig.config.root import Config
    from rig.recording.run import Recording

ALONE = "commands.identify_batch.alone"


class ProcessEnded(RuntimeError):
    """The process of its own that a campaign was given was ended from outside."""


def identify_campaign(job: Job) -> Row:
    """Identify one campaign; whatever is wrong with it is a row that says so.

    A campaign with effects of its own or with measured channels is given a process of its own.

    Raises
    ------
    ProcessEnded
        Where that process was killed.
    """
    if keeps_apart(_texts_of(job)):
        return _in_a_process_of_its_own(job)
    return identified_here(job)


def identified_here(job: Job) -> Row:
    """The same in this process."""
    started = time.perf_counter()
    known: dict[str, Any] = {"name": _name_of(Path(job.file))}
    try:
        config, recording, date = _read(job)
        known |= {"rig": config.name, "config_sha256": _config_hash(config), "recorded_utc": date}
        found = _identified(config, recording)
        results = _kept(job, config, recording, found) if job.results is not None else None
    except Exception as error:  # noqa: BLE001 (one campaign must not end the others; its row says why)
        return failed_row(job, _reason(error), version(), time.perf_counter() - started, known)
    return row_of(job, found, known, results, version(), time.perf_counter() - started)


def _reason(error: Exception) -> str:
    from commands.terminal.exit_codes import message_of

    if isinstance(error, RigError):
        return str(error)
    if isinstance(error, MemoryError):
        return "the worker ran out of memory: run fewer campaigns at once (--workers)"
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {error.strerror or error}"
    return message_of(error, None)


def _read(job: Job) -> tuple[Config, Recording, str | None]:
    """Configuration, recording, and when it was played where that is known."""
    from commands.campaign.provenance import provenance
    from rig.config.load import load_config
    from rig.recording.load import read_recording

    file = Path(job.file)
    if job.is_recording:
        return _read_results(file, job.overrides)
    loaded = load_config(file, job.overrides)
    if loaded.config.backend != "recorded":
        raise ConfigError(
            f"{file}: backend is {loaded.config.backend}, and only recorded campaigns are identified here"
        )
    recording = read_recording(loaded)
    dates = [_played_at(Path(name)) for name in recording.info.get("files", ()) if Path(name).suffix == ".h5"]
    recording = dataclasses.replace(recording, info=dict(recording.info) | provenance(loaded))
    return loaded.config, recording, min((d for d in dates if d is not None), default=None)


def _read_results(file: Path, overrides: tuple[str, ...]) -> tuple[Config, Recording, str | None]:
    """A recording.h5 with the configuration that it quotes; of a campaign cut short the complete sets alone."""
    from rig.config.load import config_as_recorded
    from rig.recording.hdf5 import read_recording_h5

    recording = read_recording_h5(file)
    info = recording.info
    text = info.get("config_text")
    if not isinstance(text, str):
        raise RecordingError(
            f"{file}: does not contain its configuration: name it in a rig.yaml (backend: recorded) and match that"
        )
    source = Path(str(info.get("config_file", "rig.yaml")))
    included = {str(k): str(v) for k, v in dict(info.get("config_included") or {}).items()}
    config = config_as_recorded(text, source, list(info.get("config_overrides") or ()), included, overrides)
    if info.get("aborted"):
        done = {one["name"] for one in info.get("sets", ()) if one.get("complete")}
        recording = dataclasses.replace(recording, runs=tuple(run for run in recording.runs if run.name in done))
    if not recording.runs:
        raise RecordingError(f"{file}: no set was completed: play it again, or finish it with --resume")
    return config, recording, _date_in(info)


def _identified(config: Config, recording: Recording) -> Identification:
    from identify.conclude.plausibility import with_declared
    from identify.pipeline import identify

    blind = dataclasses.replace(recording, info={})
    found = with_declared(identify(blind, config.model.platform(), config.identify), config.model.declared_numbers)
    found = dataclasses.replace(found, recorded=config.backend == "recorded")
    cut_short = recording.info.get("aborted")
    if not cut_short:
        return found
    reasons = (f"the campaign was cut short, this is from its complete sets: {cut_short}", *found.reasons)
    return dataclasses.replace(found, aborted=True, reasons=reasons)


def _kept(job: Job, config: Config, recording: Recording, found: Identification) -> str:
    """Write the results folder under a name of this process, then give it its own: it is there whole or not at all."""
    from identify.follow_up.planner import plan_follow_up, with_follow_up
    from identify.follow_up.rounds import limits_of, sample_rate_hz
    from identify.report.files import write_results

    folder = Path(str(job.results))
    if not found.aborted:
        allowed = limits_of(found, config.limits, found.axis == "linear")
        blind, rate_hz = dataclasses.replace(recording, info={}), sample_rate_hz(recording)
        plan = plan_follow_up(found, blind, allowed, rate_hz, config.excitation.rest_s, "follow-up")
        found = with_follow_up(found, plan)
    partial = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    shutil.rmtree(partial, ignore_errors=True)
    partial.mkdir(parents=True)
    model = config.model
    try:
        write_results(partial, found, recording, model.platform(), config.name, inertia_declared=model.inertia_declared)
        if not folder.exists():  # else an earlier attempt at the same content has got here
            partial.rename(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return str(folder)


def _played_at(file: Path) -> str | None:
    from rig.recording.hdf5 import read_recording_h5

    try:
        return _date_in(read_recording_h5(file).info)
    except RecordingError:  # an HDF5 file of another program
        return None


def _date_in(info: Any) -> str | None:
    """When the recording was played; without ``played_on`` the date says when it was read."""
    date = info.get("started_utc")
    return date if isinstance(date, str) and info.get("played_on") else None


def _config_hash(config: Config) -> str:
    text = json.dumps(
        config.model_dump(mode="json", include={"model", "identify", "recorded"}), sort_keys=True, default=str
    )
    return hashlib.sha256(text.encode()).hexdigest()


def _name_of(file: Path) -> str:
    """The results folder's name, or that of the yaml; of a rig.yaml that of the folder that it stands in."""
    return file.parent.name if file.name in (RECORDING_FILE, "rig.yaml") else file.stem


def _texts_of(job: Job) -> list[str]:
    from rig.recording.hdf5 import read_recording_h5

    texts = list(job.overrides)
    if job.is_recording:
        try:
            info = read_recording_h5(job.file).info
        except (RigError, OSError):  # said when it is identified
            return texts
        return [*texts, str(info.get("config_text", "")), str(info.get("config_included", ""))]
    files = [f for f in inputs_of(Path(job.file), job.overrides) if f.suffix.lower() in (".yaml", ".yml", ".py")]
    return [*texts, *(f.read_text(encoding="utf-8", errors="replace") for f in files if f.is_file())]


def _in_a_process_of_its_own(job: Job) -> Row:
    """Its stdin stays open while this worker lives: with the worker it ends too."""
    with subprocess.Popen(
        [sys.executable, "-m", ALONE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, encoding="utf-8", errors="replace",
    ) as process:  # fmt: skip
        assert process.stdin is not None and process.stdout is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended already, which its output says
            process.stdin.write(json.dumps(dataclasses.asdict(job)) + "\n")
            process.stdin.flush()
        said = process.stdout.read()
    try:
        row: Row = json.loads(said.splitlines()[-1])
    except (IndexError, ValueError):
        raise ProcessEnded(f"its process ended with {process.returncode}: {said[-500:]}".rstrip(": ")) from None
    return row
