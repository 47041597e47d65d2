"""Playing a campaign from the command line: forecast, consent, folder, journal, sequencer, recording.h5.

Whatever ends it, torque is off first and what was recorded is kept; the error comes back with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
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
from rig.guard_motion import motion_checks
from rig.interface import Rig, Statement, Torque
from rig.preflight import plan
from rig.probe import Probe
from rig.recorder import SetStatistics
from rig.recording.hdf5 import write_recording_h5
from rig.recording.journal import Journal, JournalError
from rig.recording.journal_reader import JournalContents, read_journal, recording_from_journal
from rig.recording.results import joined
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
    journals
        The raw journals of its parts in the results folder, in the order they were played.
    rate_full_scale_rad_s
        The largest rate that the gyro reports, or None.
    """

    recording: Recording
    whole: frozenset[str]
    cause: BaseException | None
    journals: tuple[str, ...] = (JOURNAL_FILE,)
    rate_full_scale_rad_s: float | None = None

    @property
    def fit_to_identify(self) -> Recording:
        """The whole runs: a run that was cut short may end in the fault that cut it."""
        runs = tuple(run for run in self.recording.runs if run.name in self.whole)
        return dataclasses.replace(self.recording, runs=runs)


@dataclass(frozen=True)
class Part:
    """One part of a campaign: what its files are called, what stands in the folder already, who is asked.

    ``earlier`` is what was played before: into the same folder, where its recording is kept and added to, or into
    the one that this part ``resumes``; then its journals are ``brought``, each under its new name.
    """

    journal: str = JOURNAL_FILE
    raw: str = RAW_FOLDER
    earlier: Played | None = None
    consent: Callable[[Statement, bool, bool, Callable[[str], str]], None] = ask_consent
    brought: tuple[tuple[Path, str], ...] = ()
    resumes: Path | None = None

    @property
    def done(self) -> frozenset[str]:
        """Names of the sets that are not played again."""
        return self.earlier.whole if self.earlier is not None and self.resumes is not None else frozenset()

    def bring(self, path: Path) -> None:
        """Copy what was played before into the folder of this part. Raises OSError."""
        for source, name in self.brought:
            shutil.copyfile(source, path / name)


ALL_OF_IT = Part()


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


def play(desk: Desk, loaded: LoadedConfig, folder: ResultsFolder, part: Part = ALL_OF_IT) -> Played:
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
    with BACKENDS[backend](loaded, folder.path / part.raw) as stage:
        every = planned_sets(stage.rig, loaded)
        sets = tuple(planned for planned in every if planned.name not in part.done)
        _open(desk, stage, loaded, sets, folder.path, part)
        return _record(desk, stage, loaded, sets, folder, part, [planned.name for planned in every])


def export_earlier(
    desk: Desk, loaded: LoadedConfig, folder: ResultsFolder, part: Part, header: Mapping[str, Any]
) -> Played:
    """Make a folder of what was played before, where nothing is left to play."""
    path = folder.made()
    part.bring(path)
    assert part.earlier is not None
    info = dict(header) | provenance(loaded) | {"resumed_from": str(part.resumes), "aborted": None}
    contents = joined([c for _, name in part.brought if (c := _read_back(desk, path / name)) is not None])
    recording = dataclasses.replace(part.earlier.recording, info=info, noise=header.get("noise"))
    with desk.stops.saving():
        write_recording_h5(path / RECORDING_FILE, recording, contents)
    return dataclasses.replace(part.earlier, recording=recording)


def planned_sets(rig: Rig, loaded: LoadedConfig) -> tuple[PlannedSet, ...]:
    """The sets to play. Raises PreflightRefusal that says where the limits stand which they would break."""
    config = loaded.config
    scale, key = rig.rate_full_scale_rad_s, rig.rate_full_scale_key
    try:
        return plan(config.model.platform(), config.excitation, config.limits, scale, key)
    except PreflightRefusal as error:
        raise with_places(error, loaded) from None


def _open(desk: Desk, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet], path: Path, part: Part) -> None:
    statement = stage.rig.statement()
    loudly = desk.terminal.insist if statement.torque is Torque.REAL else desk.terminal.tell
    loudly(opening(statement, loaded.config, sets, path))
    desk.terminal.settle()
    part.consent(statement, desk.options.yes, sys.stdin is not None and sys.stdin.isatty(), _ask)


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
        self.verdict_s: float | None = None
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
        platform, asked = config.model.platform(), stage.rig.probe
        in_memory = stage.rig.statement().torque is Torque.SIMULATED  # the bench's are in the journal, however long
        sequencer = Sequencer(
            stage.rig,
            stage.clock,
            Guard(config.limits, motion_checks(config.limits, platform)),
            sample_rate_hz=config.excitation.sample_rate_hz,
            rest_s=config.excitation.rest_s,
            journal=journal,
            observer=self.tally,
            stop=self._desk.stops.poll,
            probe=None if asked is None else Probe(asked, config.limits, platform, self._sets),
            keep_runs=in_memory,
        )
        try:
            with self._desk.stops.playing(stage.rig.torque_off):
                campaign = sequencer.play(self._sets)
            self.recording = campaign.recording if in_memory else None
            self.cause = campaign.cause
            self.verdict_s = campaign.verdict_s
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (torque is off by now; what is there is saved)
            self.cause = as_known(error)


def _record(
    desk: Desk, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet], folder: ResultsFolder, part: Part,
    every: Sequence[str],
) -> Played:  # fmt: skip
    """Play, then export what the journal and the sequencer have; ``every`` names all sets of the campaign."""
    path = folder.made()
    part.bring(path)
    played_on = backend_name(loaded.config, desk.options.dry_run, desk.options.emulate)
    info = provenance(loaded) | {"backend": str(stage.rig.statement()), "played_on": played_on}
    recorder = _Recorder(desk, stage, loaded, sets)
    if part.resumes is not None:
        info["resumed_from"] = str(part.resumes)
    head = {"axis": "rotary", "noise": stage.rig.noise_rad_s, "planned": [s.name for s in sets]} | info
    head["planned_in_all"] = list(every)
    recorder.run(Journal.create(path / part.journal, head))
    cause, tally = recorder.cause, recorder.tally
    if isinstance(cause, UsageError) and not tally.statistics:
        _take_back(folder, part)
        raise cause
    if cause is not None:
        desk.say_error(cause)
    info |= {"ended_utc": datetime.now(UTC).isoformat(), "aborted": str(cause) if cause else None}
    info |= {"verdict_time_s": recorder.verdict_s}
    info |= {"sets": [_figures(s) for s in tally.statistics]} | stage.account()
    played = Played(Recording(()), tally.whole, cause, (part.journal,), stage.rig.rate_full_scale_rad_s)
    with desk.stops.saving():
        return _save(desk, path, recorder.recording, info, played, part)


def _take_back(folder: ResultsFolder, part: Part) -> None:
    """Take back what was made for a part in which nothing was played."""
    if part.earlier is None or part.resumes is not None:
        folder.unmade()
    else:
        (folder.path / part.journal).unlink(missing_ok=True)


def _save(
    desk: Desk, path: Path, recording: Recording | None, info: Mapping[str, Any], played: Played, part: Part
) -> Played:
    """Write recording.h5; a disk that takes no more is said, and the journals have the samples."""
    earlier = part.earlier
    contents = _read_back(desk, path / played.journals[0])
    if recording is None:
        recording = recording_from_journal(contents) if contents is not None else Recording(())
    recording = dataclasses.replace(recording, info=dict(info))
    if earlier is not None:
        before = [_read_back(desk, path / name) for name in earlier.journals]
        contents = joined([c for c in (*before, contents) if c is not None])
        recording = (_added if part.resumes is None else _resumed)(earlier.recording, recording)
        played = dataclasses.replace(
            played, whole=played.whole | earlier.whole, journals=(*earlier.journals, *played.journals)
        )
    if recording.runs:
        try:
            _write(path, recording, contents, anew=(path / RECORDING_FILE).exists())
        except RigError as problem:
            desk.say_error(problem)
    return dataclasses.replace(played, recording=recording)


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
        raise JournalError(f"cannot write {path / RECORDING_FILE}: {error.strerror}; {new} has everything") from error


def _read_back(desk: Desk, path: Path) -> JournalContents | None:
    try:
        return read_journal(path)
    except RigError as problem:
        desk.say_error(problem)
        return None


def _added(earlier: Recording, new: Recording) -> Recording:
    """All runs of a campaign; what is said of the new part stands behind what was said of the first."""
    info = dict(earlier.info)
    info["follow_ups"] = [*info.get("follow_ups", ()), dict(new.info)]
    return dataclasses.replace(earlier, runs=(*earlier.runs, *new.runs), info=info)


def _resumed(earlier: Recording, new: Recording) -> Recording:
    """The finished runs of before and those of now; what is said is of now, and names the folder of before."""
    return dataclasses.replace(new, runs=(*earlier.runs, *new.runs))


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
