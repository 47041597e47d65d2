"""The command `identify-run`: play or read a campaign, identify, close the loop, write the results folder."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import typer

from commands.campaign.context import CommandContext, Options, run_command
from commands.identification.results import conclude, conclude_aborted, identified
from commands.identify_run.follow_up import followed_up, with_plan
from commands.terminal.options import (
    ConfigFile,
    DryRun,
    Emulate,
    Live,
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
    from commands.campaign.results_folder import ResultsFolder
    from rig.config.load import LoadedConfig

RESULTS = {  # by exit code
    0: "Finished: accepted",
    1: "Finished: not accepted, the report says why",
    3: "Device fault: torque is off, what was recorded is kept",
    4: "Safety trip: torque is off, what was recorded is kept",
    130: "Stopped: torque is off, what was recorded is kept",
}
app = new_app("")


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
    live: Live = False,
    version: Version = False,
) -> None:
    """Play the campaign of CONFIG (or read its recordings), identify J, C and K, name what the model lacks.

    Exit codes: 0 identified and accepted, 1 not accepted (the results say why), 2 wrong usage, wrong file, or a set
    that would exceed a limit, 3 device fault, 4 safety trip, 70 internal error, 130 Ctrl-C.
    """
    options = Options(config, out, dry_run, emulate, yes, tuple(overrides or ()), seed, quiet, resume, live)
    raise typer.Exit(run_command(options, run))


def run(context: CommandContext) -> int:
    """The main job; returns the exit code."""
    from commands.campaign.backends import RECORDED, backend_name
    from commands.live.view import live_view
    from rig.errors import UsageError

    options = context.options
    loaded = options.load()
    folder = context.choose_folder(loaded.config.name)
    if backend_name(loaded.config, options.dry_run, options.emulate) == RECORDED and options.resume is None:
        if options.live:
            raise UsageError(
                "--live shows a campaign while it plays, and backend: recorded plays nothing. Leave it out."
            )
        return _run_recorded(context, loaded, folder)
    if not options.live:
        return _run_played(context, loaded, folder)
    with live_view(context.stops.request, context.terminal.show_always) as context.live:
        code = _run_played(context, loaded, folder)
        report = folder.path / "report.html"
        ended = RESULTS.get(code, f"Ended with exit code {code}: see the terminal")
        context.live.finished(ended, report if report.exists() else None)
        return code


def _run_recorded(context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    """Nothing is written before the recordings have proved good for something."""
    from commands.campaign.announcement import recorded_announcement
    from commands.campaign.provenance import provenance
    from rig.recording.load import read_recording

    recording = read_recording(loaded)
    files = recording.info.get("files", ())
    context.terminal.show(recorded_announcement(len(set(files)), len(recording.runs), folder.path))
    recording = dataclasses.replace(recording, info=dict(recording.info) | provenance(loaded))
    found = identified(context, loaded, recording)
    if not found.aborted:
        from identify.follow_up.rounds import limits_of, sample_rate_hz

        allowed = limits_of(found, loaded.config.limits, found.axis == "linear")
        found = with_plan(context, loaded, recording, found, allowed, sample_rate_hz(recording))
    return conclude(context, loaded, folder, recording, found)


def _run_played(context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    from commands.campaign.resume import play_campaign
    from commands.identify_run.prove import proved_if_asked
    from commands.terminal.exit_codes import NOT_ACCEPTED, exit_code_of
    from rig.errors import Aborted, UsageError

    played = play_campaign(context, loaded, folder)
    cause = played.cause
    if cause is None:
        try:
            found = identified(context, loaded, played.recording)
        except (Aborted, KeyboardInterrupt):
            context.terminal.show_always(f"Stopped before anything was identified. The recording is in {folder.path}")
            raise
        except UsageError as error:  # the campaign was played, so this is no matter of usage any more
            context.say_error(error)
            return NOT_ACCEPTED
        if not found.aborted:
            played, found = followed_up(context, loaded, folder, played, found)
        proved = proved_if_asked(context, loaded, folder, played, found)
        played = proved.played
        code = conclude(context, proved.loaded, folder, proved.recording, proved.found)
        return code if played.cause is None else exit_code_of(played.cause)
    try:
        conclude_aborted(context, loaded, folder, played)
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (what ended the campaign decides; this is said)
        context.say_error(error)
    return exit_code_of(cause)
