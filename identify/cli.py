"""The command `identify-run`: play or read a campaign, identify, close the loop, write the results folder."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from typing import TYPE_CHECKING

import typer

from rig.cli.desk import Desk, Options, at_desk
from rig.cli.exits import leave_warnings_to_developers
from rig.cli.options import ConfigFile, DryRun, Emulate, Out, Overrides, Quiet, Seed, Version, Yes, new_app

if TYPE_CHECKING:
    from identify.results import Identification
    from rig.cli.campaign import Played
    from rig.cli.results_folder import ResultsFolder
    from rig.config.load import LoadedConfig
    from rig.recording.run import Recording

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
    version: Version = False,
) -> None:
    """Play the campaign of CONFIG (or read its recordings), identify J, C and K, name what the model misses.

    Exit codes: 0 identified and accepted, 1 not accepted (the results say why), 2 wrong usage, file or forecast,
    3 device fault, 4 safety trip, 70 internal error, 130 Ctrl-C.
    """
    options = Options(config, out, dry_run, emulate, yes, tuple(overrides or ()), seed, quiet)
    raise typer.Exit(at_desk(options, run))


def main() -> None:
    """Entry point of `identify-run`."""
    leave_warnings_to_developers()
    app(prog_name="identify-run")


def run(desk: Desk) -> int:
    """The main job; returns the exit code."""
    from rig.cli.backends import RECORDED, backend_name

    options = desk.options
    loaded = options.load()
    folder = desk.choose_folder(loaded.config.name)
    if backend_name(loaded.config, options.dry_run, options.emulate) == RECORDED:
        return _run_recorded(desk, loaded, folder)
    return _run_played(desk, loaded, folder)


def _run_recorded(desk: Desk, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    """Nothing is written before the recordings have proved good for something."""
    from rig.cli.opening import opening_recorded
    from rig.cli.provenance import provenance
    from rig.recording.load import read_recording

    recording = read_recording(loaded)
    files = recording.info.get("files", ())
    desk.terminal.tell(opening_recorded(len(set(files)), len(recording.runs), folder.path))
    recording = dataclasses.replace(recording, info=dict(recording.info) | provenance(loaded))
    found = _identified(desk, loaded, recording)
    return _conclude(desk, loaded, folder, recording, found)


def _run_played(desk: Desk, loaded: LoadedConfig, folder: ResultsFolder) -> int:
    from rig.cli.campaign import play
    from rig.cli.exits import NOT_ACCEPTED, code_of
    from rig.errors import Aborted, UsageError

    played = play(desk, loaded, folder)
    cause = played.cause
    if cause is None:
        try:
            found = _identified(desk, loaded, played.recording)
        except (Aborted, KeyboardInterrupt):
            desk.terminal.insist(f"Stopped before anything was identified. What was recorded is in {folder.path}")
            raise
        except UsageError as error:  # the campaign was played, so this is no matter of usage any more
            desk.say_error(error)
            return NOT_ACCEPTED
        return _conclude(desk, loaded, folder, played.recording, found)
    try:
        _conclude_aborted(desk, loaded, folder, played)
    except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 (what ended the campaign decides; this is said)
        desk.say_error(error)
    return code_of(cause)


def _conclude_aborted(desk: Desk, loaded: LoadedConfig, folder: ResultsFolder, played: Played) -> None:
    """Identify from the sets that came to their end, and mark it."""
    whole = played.fit_to_identify
    if not whole.runs:
        desk.terminal.insist(f"No set was complete, so nothing is identified. What was recorded is in {folder.path}")
        return
    desk.terminal.tell(f"Identifying from the {len(whole.runs)} complete set(s); the results are marked aborted.")
    found = dataclasses.replace(_identified(desk, loaded, whole), aborted=True)
    _conclude(desk, loaded, folder, whole, found)


def _identified(desk: Desk, loaded: LoadedConfig, recording: Recording) -> Identification:
    """What the recording shows. ``info``, which quotes the configuration, stays outside."""
    from identify.loop import identify

    config = loaded.config
    blind = dataclasses.replace(recording, info={})
    return identify(blind, config.model.platform(), config.identify, desk.terminal.note)


def _conclude(
    desk: Desk, loaded: LoadedConfig, folder: ResultsFolder, recording: Recording, found: Identification
) -> int:
    """Write the results and the summary; returns 0 or 1."""
    from identify.summary import WIDTH, summary
    from identify.writing import write_results
    from rig.cli.exits import NOT_ACCEPTED, OK, STOPPED

    path = folder.made()
    with desk.stops.saving():
        write_results(path, found, recording, loaded.config.model.platform(), loaded.config.name)
    desk.terminal.settle()
    if not desk.options.quiet:
        is_terminal = sys.stdout.isatty()
        width = shutil.get_terminal_size().columns if is_terminal else WIDTH
        sys.stdout.write(summary(found, width, colour=is_terminal) + f"\nResults: {path}\n")
    if found.accepted:
        return OK
    if found.aborted:
        desk.terminal.insist("Stopped: torque is off, what was recorded is kept, the results are marked aborted.")
        return STOPPED
    for reason in found.reasons:
        desk.terminal.insist(f"Not accepted: {reason}")
    return NOT_ACCEPTED
