"""`rig play`: play and record only."""

from __future__ import annotations

import sys

from commands.campaign.context import CommandContext
from commands.campaign.resume import play_campaign
from commands.campaign.saving import describe_location
from commands.terminal.display import counted, plain
from commands.terminal.exit_codes import exit_code_of
from rig.config.load import LoadedConfig


def play_only(context: CommandContext, loaded: LoadedConfig) -> int:
    """Play the campaign and say where its recording is; returns the exit code."""
    folder = context.choose_folder(loaded.config.name)
    played = play_campaign(context, loaded, folder)
    context.terminal.flush()
    if not context.options.quiet:
        where = (
            f"; the recording is in {folder.path}"
            if played.recording.runs
            else f". {describe_location(played, folder.path)}"
        )
        sys.stdout.write(f"{counted(len(played.completed), 'complete set')}{plain(where)}\n")
    return 0 if played.cause is None else exit_code_of(played.cause)
