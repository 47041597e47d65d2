"""Identifies a recording, writes the results folder and prints the summary."""

from __future__ import annotations

import dataclasses
import shutil
import sys
from typing import TYPE_CHECKING

from commands.campaign.context import CommandContext
from commands.terminal.display import counted

if TYPE_CHECKING:
    from commands.campaign.campaign_part import PlayedCampaign
    from commands.campaign.results_folder import ResultsFolder
    from identify.results import Identification
    from rig.config.load import LoadedConfig
    from rig.recording.run import Recording


def identified(context: CommandContext, loaded: LoadedConfig, recording: Recording) -> Identification:
    """What the recording shows. ``info``, which quotes the configuration, stays outside."""
    from identify.conclude.plausibility import with_declared
    from identify.pipeline import identify

    config = loaded.config
    blind = dataclasses.replace(recording, info={})
    found = identify(blind, config.model.platform(), config.identify, context.note)
    found = with_declared(found, config.model.declared_numbers)
    return dataclasses.replace(found, recorded=config.backend == "recorded")


def conclude(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, recording: Recording, found: Identification
) -> int:
    """Write the results and the summary; returns 0, 1, or 130 where somebody asked to stop."""
    from commands.terminal.exit_codes import NOT_ACCEPTED, OK, STOPPED
    from identify.report.summary import PLAIN_WIDTH, summary

    late = context.stops.outstanding()  # by the loss of the terminal, or in a library that swallows what is raised
    if late is not None and not found.aborted:
        found = dataclasses.replace(found, aborted=True, accepted=False, reasons=(f"{late}.", *found.reasons))
    try:
        write(context, loaded, folder, recording, found)
    finally:  # a disk that does not take the results is no reason to keep them back
        context.terminal.flush()
        if not context.options.quiet:
            is_terminal = sys.stdout.isatty()
            width = shutil.get_terminal_size().columns if is_terminal else PLAIN_WIDTH
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


def conclude_aborted(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, played: PlayedCampaign
) -> None:
    """Identify from the sets that came to their end, and mark it."""
    from commands.campaign.saving import describe_location

    whole = played.complete_runs
    if not whole.runs:
        where = describe_location(played, folder.path)
        context.terminal.show_always(f"No set was completed, so nothing was identified. {where}")
        return
    context.terminal.show(
        f"Identifying from {counted(len(whole.runs), 'complete set')}; the results are marked aborted."
    )
    found = dataclasses.replace(identified(context, loaded, whole), aborted=True)
    conclude(context, loaded, folder, whole, found)


def write(
    context: CommandContext, loaded: LoadedConfig, folder: ResultsFolder, recording: Recording, found: Identification
) -> None:
    """Write the results."""
    from identify.report.files import write_results

    path = folder.create()
    with context.stops.saving():
        model = loaded.config.model
        given = model.inertia_declared
        write_results(path, found, recording, model.platform(), loaded.config.name, inertia_declared=given)
