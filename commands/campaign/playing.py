"""Playing a campaign from the command line: forecast, consent, folder, journal, sequencer, recording.h5.

Whatever ends it, torque is off first and what was recorded is kept; the error comes back with it.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from commands.campaign.announcement import announcement
from commands.campaign.backends import BACKENDS, EMULATED, Stage, backend_name
from commands.campaign.campaign_part import WHOLE_CAMPAIGN, CampaignPart, PlayedCampaign
from commands.campaign.context import CommandContext
from commands.campaign.disk_space import disk_space_warning, estimated_bytes
from commands.campaign.limit_locations import with_locations
from commands.campaign.provenance import provenance
from commands.campaign.results_folder import ResultsFolder
from commands.campaign.saving import figures, save
from commands.terminal.display import SetBars, Terminal, discard_typed_ahead
from commands.terminal.exit_codes import as_rig_error
from rig.config.load import LoadedConfig
from rig.errors import Aborted, PreflightRefusal, RigError, UsageError
from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.guard.motion import motion_checks
from rig.interface import Rig, Torque
from rig.preflight import plan
from rig.recording.journal import Journal
from rig.recording.run import Recording
from rig.sequencer import Sequencer
from rig.sequencer.probe import Probe
from rig.sequencer.recorder import SetStatistics
from rig.sequencer.warm_up import warm_up


class SetLog(SetBars):
    """Shows the sets, and remembers how each went."""

    def __init__(self, terminal: Terminal) -> None:
        super().__init__(terminal)
        self.statistics: list[SetStatistics] = []

    def set_ends(self, statistics: SetStatistics) -> None:
        """Remember, then show."""
        self.statistics.append(statistics)
        super().set_ends(statistics)

    @property
    def completed(self) -> frozenset[str]:
        """Names of the sets that are complete."""
        return frozenset(s.name for s in self.statistics if s.complete)


def play(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, part: CampaignPart = WHOLE_CAMPAIGN
) -> PlayedCampaign:
    """Play the campaign of ``loaded`` on the backend that was asked for and save its recording.

    Raises UsageError, with nothing moved or written, where it may not be played.
    """
    options, config = context.options, loaded.config
    backend = backend_name(config, options.dry_run, options.emulate)
    if backend not in BACKENDS:
        raise UsageError(
            f"backend: {backend} reads recordings and plays nothing: add --dry-run, or set backend: simulated or bench."
        )
    if backend == EMULATED:
        is_in_step = config.bench is not None and config.bench.emulator.clock == "in_step"
        how = " in step with the bench, so that no tick is late" if is_in_step else ""
        context.terminal.show(f"Starting the emulated devices{how} ...")
    with BACKENDS[backend](loaded, folder.path / part.raw) as stage:
        every = (part.plan or planned_sets)(stage.rig, loaded)
        loaded = _resting(loaded, part.rest_s())
        sets = tuple(planned for planned in every if planned.name not in part.done)
        _open(context, stage, loaded, sets, folder.path, part)
        return _record(context, stage, loaded, sets, folder, part, [planned.name for planned in every])


def _resting(loaded: LoadedConfig, rest_s: float | None) -> LoadedConfig:
    """The same with other rests between the sets, where they are given."""
    if rest_s is None:
        return loaded
    excitation = loaded.config.excitation.model_copy(update={"rest_s": rest_s})
    return replace(loaded, config=loaded.config.model_copy(update={"excitation": excitation}))


def planned_sets(rig: Rig, loaded: LoadedConfig) -> tuple[PlannedSet, ...]:
    """The sets to play. Raises PreflightRefusal that says where the limits stand which they would break."""
    config = loaded.config
    scale, key = rig.rate_full_scale_rad_s, rig.rate_full_scale_key
    try:
        return plan(config.model.platform(), config.excitation, config.limits, scale, key)
    except PreflightRefusal as error:
        raise with_locations(error, loaded) from None


def _open(
    context: CommandContext,
    stage: Stage,
    loaded: LoadedConfig,
    sets: Sequence[PlannedSet],
    path: Path,
    part: CampaignPart,
) -> None:
    statement = stage.rig.statement()
    loudly = context.terminal.show_always if statement.torque is Torque.REAL else context.terminal.show
    loudly(announcement(statement, loaded.config, sets, path, part.then))
    scarce = disk_space_warning(path, estimated_bytes(loaded.config, statement, sets, part))
    if scarce:
        context.terminal.show_always(scarce)
    context.terminal.flush()
    part.consent(statement, context.options.yes, sys.stdin is not None and sys.stdin.isatty(), _ask)


def _ask(question: str) -> str:
    """Put a question on stderr; returns the line that was typed after it. Raises EOFError where none comes."""
    discard_typed_ahead(sys.stdin)
    sys.stderr.write(question)
    sys.stderr.flush()
    try:
        answer = sys.stdin.readline()
    except OSError:
        raise Aborted("the terminal was closed; nothing was played.") from None
    if not answer:
        raise EOFError
    return answer


class _CampaignRecorder:
    """One campaign while it is recorded. What came of it stays here, whatever happens on the way out."""

    def __init__(self, context: CommandContext, stage: Stage, loaded: LoadedConfig, sets: Sequence[PlannedSet]) -> None:
        self.set_log = SetLog(context.terminal)
        self.recording: Recording | None = None
        self.cause: BaseException | None = None
        self.verdict_s: float | None = None
        self._context, self._stage, self._config, self._sets = context, stage, loaded.config, sets

    def run(self, journal: Journal) -> None:
        """Play into the journal and close it."""
        is_simulated = self._stage.rig.statement().torque is Torque.SIMULATED
        try:
            with journal, contextlib.nullcontext() if is_simulated else journal.flushing_in_background():
                self._play(journal)
        except RigError as error:
            self.cause = self.cause or error

    def _guard(self) -> Guard:
        limits = self._config.limits
        return Guard(limits, motion_checks(limits, self._config.model.platform()))

    def _play(self, journal: Journal) -> None:
        stage, config = self._stage, self._config
        platform, asked = config.model.platform(), stage.rig.probe
        in_memory = stage.rig.statement().torque is Torque.SIMULATED  # the bench's are in the journal, however long
        if not in_memory:
            warm_up(self._guard(), platform, self._sets, config.excitation.sample_rate_hz)
        sequencer = Sequencer(
            stage.rig,
            stage.clock,
            self._guard(),
            sample_rate_hz=config.excitation.sample_rate_hz,
            rest_s=config.excitation.rest_s,
            journal=journal,
            observer=self.set_log,
            stop=self._context.stops.poll,
            probe=None if asked is None else Probe(asked, config.limits, platform, self._sets),
            keep_runs=in_memory,
            declared=platform,
        )
        try:
            with self._context.stops.playing(stage.rig.torque_off):
                campaign = sequencer.play(self._sets)
            self.recording = campaign.recording if in_memory else None
            self.cause = campaign.cause
            self.verdict_s = campaign.verdict_s
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (torque is off by now; what is there is saved)
            self.cause = as_rig_error(error)


def _record(
    context: CommandContext,
    stage: Stage,
    loaded: LoadedConfig,
    sets: Sequence[PlannedSet],
    folder: ResultsFolder,
    part: CampaignPart,
    every: Sequence[str],
) -> PlayedCampaign:
    """Play, then export what the journal and the sequencer have; ``every`` names all sets of the campaign.

    A signal after the last tick counts too: all is saved, and the campaign ends as one that was stopped.
    """
    path = folder.create()
    part.copy_journals(path)
    played_on = backend_name(loaded.config, context.options.dry_run, context.options.emulate)
    info = provenance(loaded) | {"backend": str(stage.rig.statement()), "played_on": played_on}
    recorder = _CampaignRecorder(context, stage, loaded, sets)
    if part.resumes is not None:
        info["resumed_from"] = str(part.resumes)
    head = {"axis": "rotary", "noise": stage.rig.noise_rad_s, "planned": [s.name for s in sets]} | info
    head["planned_in_all"] = list(every)
    with context.stops.deferring():
        journal = Journal.create(path / part.journal, head)
        _show_live(context, loaded, sets, journal.path)
        recorder.run(journal)
        played = _saved(context, stage, recorder, info, folder, part)
    return played if played.cause is not None else replace(played, cause=_late_stop(context))


def _show_live(context: CommandContext, loaded: LoadedConfig, sets: Sequence[PlannedSet], journal: Path) -> None:
    limits = loaded.config.limits
    known = {"travel_deg": limits.travel_deg, "rate_deg_s": limits.rate_deg_s, "torque_nm": limits.torque_nm}
    planned = [(one.name, one.duration_s) for one in sets]
    context.live.plays(planned, known, journal, loaded.config.model.platform().terms)


def _saved(
    context: CommandContext,
    stage: Stage,
    recorder: _CampaignRecorder,
    info: dict[str, Any],
    folder: ResultsFolder,
    part: CampaignPart,
) -> PlayedCampaign:
    """What was played, written and told. Raises UsageError where it was refused before anything was."""
    cause, set_log = recorder.cause or _late_stop(context), recorder.set_log
    if isinstance(cause, UsageError) and not set_log.statistics:
        _discard_part(folder, part)
        raise cause
    if cause is not None:
        context.say_error(cause)
    info |= {"ended_utc": datetime.now(UTC).isoformat(), "aborted": str(cause) if cause else None}
    info |= {"verdict_time_s": recorder.verdict_s}
    info |= {"sets": [figures(s) for s in set_log.statistics]} | stage.account()
    expected = stage.rig.expected_delay
    if expected is not None:
        info["expected_torque_delay"] = expected._asdict()
    played = PlayedCampaign(Recording(()), set_log.completed, cause, (part.journal,), stage.rig.rate_full_scale_rad_s)
    return save(context, folder.path, recorder.recording, info, played, part)


def _late_stop(context: CommandContext) -> Aborted | None:
    """The request to stop that came after the last tick, when nobody polled any more."""
    reason = context.stops.outstanding()
    return Aborted(f"{reason}: torque is off; what was recorded until then is kept.") if reason else None


def _discard_part(folder: ResultsFolder, part: CampaignPart) -> None:
    """Take back what was made for a part in which nothing was played."""
    if part.earlier is None or part.resumes is not None:
        folder.discard()
    else:
        (folder.path / part.journal).unlink(missing_ok=True)
