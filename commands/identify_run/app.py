"""The command `identify-run`: play or read a campaign, identify, close the loop, write the results folder."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from typing import TYPE_CHECKING

import typer

from commands.campaign.context import CommandContext, Options, run_command
from commands.terminal.options import (
    ConfigFile,
    DryRun,
    Emulate,
    Out,
    Overrides,
    Quiet,
    Resume,
    Seed,
    Version,
    Yes,
    new_app,
)

if TYPE_CHECKING:
    from commands.campaign.campaign_part import PlayedCampaign
    from commands.campaign.results_folder import ResultsFolder
    from identify.results import Identification
    from rig.config.load import LoadedConfig
    from rig.platform import Platform
    from rig.preflight import Peaks
    from rig.recording.run import Recording

app = new_app("")
STOPPED_AGAIN = "stopped during identification with all data: these are the results without the follow-up"


@app.command()
def identify_run(
    config: ConfigFile,
    out: Out = None,
    dry_run: DryRun = False,
    emulate: Emulate = False,
    yes: Yes = False,
    overrides: Overrides = None,
    seed: Seed = None,
    quiet: Quiet = False,
    resume: Resume = None,
    version: Version = False,
) -> None:
    """Play the campaign of CONFIG (or read its recordings), identify J, C and K, name what the model misses.

    Exit codes: 0 identified and accepted, 1 not accepted (the results say why), 2 wrong usage, file or forecast,
    3 device fault, 4 safety trip, 70 internal error, 130 Ctrl-C.
    """
    options = Options(config, out, dry_run, emulate, yes, tuple(overrides or ()), seed, quiet, resume)
    raise typer.Exit(run_command(options, run))


def run(context: CommandContext) -> int:
    """The main job; returns the exit code."""
    from commands.campaign.backends import RECORDED, backend_name

    options = context.options
    loaded = options.load()
    folder = context.choose_folder(loaded.config.name)
    if backend_name(loaded.config, options.dry_run, options.emulate) == RECORDED and options.resume is None:
        return _run_recorded(context, loaded, folder)
    return _run_played(context, loaded, folder)


def _run_recorded(context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    """Nothing is written before the recordings have proved good for something."""
    from commands.campaign.announcement import recorded_announcement
    from commands.campaign.provenance import provenance
    from rig.recording.load import read_recording

    recording = read_recording(loaded)
    files = recording.info.get("files", ())
    context.terminal.show(recorded_announcement(len(set(files)), len(recording.runs), folder.path))
    recording = dataclasses.replace(recording, info=dict(recording.info) | provenance(loaded))
    found = _identified(context, loaded, recording)
    if not found.aborted:
        from identify.follow_up.rounds import limits_of

        allowed = limits_of(found, loaded.config.limits, found.axis == "linear")
        found = _planned(context, loaded, recording, found, allowed, _sample_rate_hz(recording))
    return _conclude(context, loaded, folder, recording, found)


def _sample_rate_hz(recording: Recording) -> float:
    """Of the first run, to four digits, within what a rig plays at."""
    import numpy as np

    rate = 1.0 / float(np.median(np.diff(recording.runs[0].time_s)))
    return float(f"{min(max(rate, 10.0), 20_000.0):.4g}")


def _run_played(context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    from commands.campaign.resume import play_campaign
    from commands.terminal.exit_codes import NOT_ACCEPTED, exit_code_of
    from rig.errors import Aborted, UsageError

    played = play_campaign(context, loaded, folder)
    cause = played.cause
    if cause is None:
        try:
            found = _identified(context, loaded, played.recording)
        except (Aborted, KeyboardInterrupt):
            context.terminal.show_always(
                f"Stopped before anything was identified. What was recorded is in {folder.path}"
            )
            raise
        except UsageError as error:  # the campaign was played, so this is no matter of usage any more
            context.say_error(error)
            return NOT_ACCEPTED
        if not found.aborted:
            played, found = _followed_up(context, loaded, folder, played, found)
        code = _conclude(context, loaded, folder, played.recording, found)
        return code if played.cause is None else exit_code_of(played.cause)
    try:
        _conclude_aborted(context, loaded, folder, played)
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (what ended the campaign decides; this is said)
        context.say_error(error)
    return exit_code_of(cause)


def _followed_up(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign, found: Identification
) -> tuple[PlayedCampaign, Identification]:
    """Plan a follow-up where a name has a rival, play it where it may be played, identify again from all the data.

    Whatever a follow-up ends in, what stood before it stands: results are written before it is played.
    """
    from identify.follow_up.rounds import promises_more
    from rig.preflight import allowed_peaks

    config = loaded.config
    allowed = allowed_peaks(config.limits, config.excitation.margin, played.rate_full_scale_rad_s)
    rate_hz, earlier_model = config.excitation.sample_rate_hz, found.final.platform
    found = _planned(context, loaded, played.recording, found, allowed, rate_hz)
    for number in (1, 2):
        if found.aborted or not promises_more(found):
            break
        _write(context, loaded, folder, played.recording, found)
        played, found, is_new = _played_on(context, loaded, folder, played, found, number)
        if not is_new:
            break
        played, found, is_new = _identified_again(context, loaded, played, found, earlier_model)
        if not is_new:
            break
        found = _planned(context, loaded, played.recording, found, allowed, rate_hz)
    return played, found


def _played_on(
    context: CommandContext,
    loaded: LoadedConfig,
    folder: ResultsFolder,
    played: PlayedCampaign,
    found: Identification,
    number: int,
) -> tuple[PlayedCampaign, Identification, bool]:
    """Play what is planned; the last of the three says whether all of it is there to identify from."""
    from commands.campaign.follow_up import play_follow_up
    from rig.errors import RigError, UsageError

    plan = found.follow_up.plan if found.follow_up else None
    if plan is None:
        return played, found, False
    try:
        more = play_follow_up(context, loaded, folder, played, plan.excitation, found.final.platform, number, plan.why)
    except UsageError as refused:
        return played, _noted(found, str(refused)), False
    except (RigError, KeyboardInterrupt) as error:  # before the first tick, at the question perhaps
        context.say_error(error)
        note = f"the follow-up was not played: {str(error) or 'stopped by Ctrl-C'}"
        return dataclasses.replace(played, cause=error), _noted(found, note, aborted=True), False
    if more.cause is None:
        return more, found, True
    note = f"the follow-up was cut short, so these are the results without it: {more.cause}"
    return more, _noted(found, note, aborted=True), False


def _identified_again(
    context: CommandContext,
    loaded: LoadedConfig,
    played: PlayedCampaign,
    found: Identification,
    earlier_model: Platform | None,
) -> tuple[PlayedCampaign, Identification, bool]:
    """Identify from all the data; where that fails or is stopped, what was found before stands."""
    from identify.follow_up.rounds import after_playing
    from rig.errors import Aborted, UsageError

    stopped: BaseException = Aborted(STOPPED_AGAIN)
    try:
        newer = _identified(context, loaded, played.recording)
        if not newer.aborted:
            return played, after_playing(found, newer, earlier_model, played.recording), True
    except (Aborted, KeyboardInterrupt) as error:
        stopped = error
    except UsageError as error:
        return played, _noted(found, f"the follow-up was played, but cannot be used: {error}"), False
    return dataclasses.replace(played, cause=stopped), _noted(found, STOPPED_AGAIN, aborted=True), False


def _noted(found: Identification, note: str, aborted: bool = False) -> Identification:
    """With a word on why the plan was not played, or what came of it."""
    follow_up = found.follow_up
    if follow_up is not None:
        found = dataclasses.replace(found, follow_up=dataclasses.replace(follow_up, note=note))
    return dataclasses.replace(found, aborted=found.aborted or aborted)


def _planned(
    context: CommandContext,
    loaded: LoadedConfig,
    recording: Recording,
    found: Identification,
    allowed: Peaks,
    rate_hz: float,
) -> Identification:
    """With a follow-up planned, where a name has a rival; a stop on the way leaves what was found, marked aborted."""
    from identify.follow_up.planner import plan_follow_up, with_follow_up
    from rig.errors import Aborted

    rounds = len(found.follow_up.rounds) if found.follow_up else 0
    prefix = "follow-up" if rounds == 0 else f"follow-up {rounds + 1}"
    if any(found.verdict.confusable_with.values()):
        context.terminal.note("planning a follow-up that separates the candidate effects")
    try:
        planned = plan_follow_up(
            found, dataclasses.replace(recording, info={}), allowed, rate_hz, loaded.config.excitation.rest_s, prefix
        )
    except (Aborted, KeyboardInterrupt):
        reasons = ("stopped while a follow-up was planned", *found.reasons)
        return dataclasses.replace(found, aborted=True, accepted=False, reasons=reasons)
    return with_follow_up(found, planned)


def _conclude_aborted(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign
) -> None:
    """Identify from the sets that came to their end, and mark it."""
    from commands.campaign.saving import describe_location

    whole = played.complete_runs
    if not whole.runs:
        where = describe_location(played, folder.path)
        context.terminal.show_always(f"No set was complete, so nothing is identified. {where}")
        return
    context.terminal.show(f"Identifying from the {len(whole.runs)} complete set(s); the results are marked aborted.")
    found = dataclasses.replace(_identified(context, loaded, whole), aborted=True)
    _conclude(context, loaded, folder, whole, found)


def _identified(context: CommandContext, loaded: LoadedConfig, recording: Recording) -> Identification:
    """What the recording shows. ``info``, which quotes the configuration, stays outside."""
    from identify.pipeline import identify

    config = loaded.config
    blind = dataclasses.replace(recording, info={})
    return identify(blind, config.model.platform(), config.identify, context.terminal.note)


def _conclude(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, recording: Recording, found: Identification
) -> int:
    """Write the results and the summary; returns 0, 1, or 130 where somebody asked to stop."""
    from commands.terminal.exit_codes import NOT_ACCEPTED, OK, STOPPED
    from identify.report.summary import WIDTH, summary

    late = context.stops.outstanding()  # by the loss of the terminal, or in a library that swallows what is raised
    if late is not None and not found.aborted:
        found = dataclasses.replace(found, aborted=True, accepted=False, reasons=(f"{late}.", *found.reasons))
    try:
        _write(context, loaded, folder, recording, found)
    finally:  # a disk that does not take the results is no reason to keep them back
        context.terminal.flush()
        if not context.options.quiet:
            is_terminal = sys.stdout.isatty()
            width = shutil.get_terminal_size().columns if is_terminal else WIDTH
            where = f"\nResults: {folder.path}" if folder.existing_path() else ""
            sys.stdout.write(f"{summary(found, width, is_terminal, recording.info)}{where}\n")
    if found.accepted:
        return OK
    if found.aborted:
        kept = "" if loaded.config.backend == "recorded" else "torque is off, what was recorded is kept, "
        context.terminal.show_always(f"Stopped: {kept}the results are marked aborted.")
        return STOPPED
    for reason in found.reasons:
        context.terminal.show_always(f"Not accepted: {reason}")
    return NOT_ACCEPTED


def _write(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, recording: Recording, found: Identification
) -> None:
    """Write the results."""
    from identify.report.files import write_results

    path = folder.create()
    with context.stops.saving():
        model = loaded.config.model
        given = model.inertia_declared
        write_results(path, found, recording, model.platform(), loaded.config.name, inertia_declared=given)
