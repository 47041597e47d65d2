"""Playing a campaign from the command line: forecast, consent, folder, journal, sequencer, recording.h5.

Whatever ends it, torque is off first and what was recorded is kept; the error comes back with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from rig.cli.backends import BACKENDS, EMULATED, Stage, backend_name
from rig.cli.desk import Desk
from rig.cli.exits import as_known
from rig.cli.opening import ask_consent, opening
from rig.cli.places import with_places
from rig.cli.provenance import provenance
from rig.cli.results_folder import JOURNAL_FILE, RAW_FOLDER, RECORDING_FILE, ResultsFolder
from rig.cli.terminal import SetBars, Terminal
from rig.config.load import LoadedConfig
from rig.errors import PreflightRefusal, RigError, UsageError
from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.interface import Rig, Torque
from rig.preflight import plan
from rig.recorder import SetStatistics
from rig.recording.hdf5 import write_recording_h5
from rig.recording.journal import Journal
from rig.recording.journal_reader import read_journal, recording_from_journal
from rig.recording.run import Recording
from rig.sequencer import Sequencer


@dataclass(frozen=True)
class Played:
    """What came of a campaign.

    Parameters
    ----------
    recording
        All runs, the last one perhaps cut short; ``info`` says how they came about.
    whole
        The names of the runs that came to their end.
    cause
        What ended the campaign early, or None.
    """

    recording: Recording
    whole: frozenset[str]
    cause: BaseException | None

    @property
    def fit_to_identify(self) -> Recording:
        """The whole runs: a run that was cut short may end in the fault that cut it."""
        runs = tuple(run for run in self.recording.runs if run.name in self.whole)
        return dataclasses.replace(self.recording, runs=runs)


class Tally(SetBars):
    """Shows the sets, and remembers how each went."""

    def __init__(self, terminal: Terminal) -> None:
        super().__init__(terminal)
        self.statistics: list[SetStatistics] = []

    def set_ends(self, statistics: SetStatistics) -> None:
        """Remember, then show."""
        self.statistics.append(statistics)
        super().set_ends(statistics)

    @property
    def whole(self) -> frozenset[str]:
        """Names of the sets that are complete."""
        return frozenset(s.name for s in self.statistics if s.complete)


def play(desk: Desk, loaded: LoadedConfig, folder: ResultsFolder) -> Played:
    """Play the campaign of ``loaded`` on the backend that was asked for and save its recording.

    Raises UsageError, with nothing moved or written, where it may not be played.
    """
    options, config = desk.options, loaded.config
    backend = backend_name(config, options.dry_run, options.emulate)
    if backend not in BACKENDS:
        raise UsageError(
            f"backend: {backend} has nothing to play: give --dry-run, or a `simulated` or `bench` backend."
        )
    if backend == EMULATED:
        desk.terminal.tell("Starting the emulated devices ...")
    with BACKENDS[backend](loaded, folder.path / RAW_FOLDER) as stage:
        sets = planned_sets(stage.rig, loaded)
        _open(desk, stage, loaded, sets, folder.path)
        return _record(desk, stage, loaded, sets, folder)


def planned_sets(rig: Rig, loaded: LoadedConfig) -> tuple[PlannedSet, ...]:
    """The sets to play. Raises PreflightRefusal that says where the limits stand which they would break."""
    config = loaded.config
    scale, key = rig.rate_full_scale_rad_s, rig.rate_full_scale_key
    try:
        return plan(config.model.platform(), config.excitation, config.limits, scale, key)
    except PreflightRefusal as error:
        raise with_places(error, loaded) from None


def _open(desk: Desk, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet], path: Path) -> None:
    statement = stage.rig.statement()
    loudly = desk.terminal.insist if statement.torque is Torque.REAL else desk.terminal.tell
    loudly(opening(statement, loaded.config, sets, path))
    desk.terminal.settle()
    ask_consent(statement, desk.options.yes, sys.stdin is not None and sys.stdin.isatty(), _ask)


def _ask(question: str) -> str:
    sys.stderr.write(question)
    sys.stderr.flush()
    answer = sys.stdin.readline()
    if not answer:
        raise EOFError
    return answer


class _Recorder:
    """One campaign while it is recorded. What came of it stays here, whatever happens on the way out."""

    def __init__(self, desk: Desk, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet]) -> None:
        self.tally = Tally(desk.terminal)
        self.recording: Recording | None = None
        self.cause: BaseException | None = None
        self._desk, self._stage, self._config, self._sets = desk, stage, loaded.config, sets

    def run(self, journal: Journal) -> None:
        """Play into the journal and close it."""
        is_simulated = self._stage.rig.statement().torque is Torque.SIMULATED
        try:
            with journal, contextlib.nullcontext() if is_simulated else journal.flushing_in_background():
                self._play(journal)
        except RigError as error:
            self.cause = self.cause or error

    def _play(self, journal: Journal) -> None:
        stage, config = self._stage, self._config
        sequencer = Sequencer(
            stage.rig,
            stage.clock,
            Guard(config.limits),
            sample_rate_hz=config.excitation.sample_rate_hz,
            rest_s=config.excitation.rest_s,
            journal=journal,
            observer=self.tally,
            stop=self._desk.stops.poll,
        )
        try:
            with self._desk.stops.playing(stage.rig.torque_off):
                campaign = sequencer.play(self._sets)
            self.recording, self.cause = campaign.recording, campaign.cause
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (torque is off by now; what is there is saved)
            self.cause = as_known(error)


def _record(
    desk: Desk, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet], folder: ResultsFolder
) -> Played:
    """Play, then export what the journal and the sequencer have."""
    path = folder.made()
    info = provenance(loaded) | {"backend": str(stage.rig.statement())}
    recorder = _Recorder(desk, stage, loaded, sets)
    recorder.run(Journal.create(path / JOURNAL_FILE, {"axis": "rotary", "noise": stage.rig.noise_rad_s} | info))
    cause, tally = recorder.cause, recorder.tally
    if isinstance(cause, UsageError) and not tally.statistics:
        folder.unmade()
        raise cause
    if cause is not None:
        desk.say_error(cause)
    info |= {"ended_utc": datetime.now(UTC).isoformat(), "aborted": str(cause) if cause else None}
    info |= {"sets": [_figures(s) for s in tally.statistics]} | stage.account()
    with desk.stops.saving():
        recording = _save(desk, path, recorder.recording, info)
    return Played(recording, tally.whole, cause)


def _save(desk: Desk, path: Path, recording: Recording | None, info: Mapping[str, Any]) -> Recording:
    """Write recording.h5; a disk that takes no more is said, and the journal has the samples."""
    contents = None
    try:
        contents = read_journal(path / JOURNAL_FILE)
    except RigError as problem:
        desk.say_error(problem)
    if recording is None:
        recording = recording_from_journal(contents) if contents is not None else Recording(())
    recording = dataclasses.replace(recording, info=dict(info))
    if recording.runs:
        try:
            write_recording_h5(path / RECORDING_FILE, recording, contents)
        except RigError as problem:
            desk.say_error(problem)
    return recording


def _figures(s: SetStatistics) -> dict[str, Any]:
    late_ms = {
        f"late_ms_p{q:g}": float(np.percentile(s.late_s, q) * 1e3) if len(s.late_s) else None
        for q in (50, 99, 99.9, 100)
    }
    return {
        "name": s.name,
        "complete": s.complete,
        "missed_ticks": s.missed_ticks,
        "invalid_samples": s.drops,
        "peak_torque_nm": s.peak_torque_nm,
    } | late_ms
