"""`rig play`: play and record only."""

from __future__ import annotations

import sys

from commands.campaign.context import Desk
from commands.campaign.resume import play_campaign
from commands.campaign.saving import where_it_is
from commands.terminal.display import plain
from commands.terminal.exit_codes import code_of
from rig.config.load import LoadedConfig


def play_only(desk: Desk, loaded: LoadedConfig) -> int:
    """Play the campaign and say where its recording is; returns the exit code."""
    folder = desk.choose_folder(loaded.config.name)
    played = play_campaign(desk, loaded, folder)
    desk.terminal.settle()
    if not desk.options.quiet:
        where = (
            f"; the recording is in {folder.path}" if played.recording.runs else f". {where_it_is(played, folder.path)}"
        )
        sys.stdout.write(f"{len(played.whole)} complete set(s){plain(where)}\n")
    return 0 if played.cause is None else code_of(played.cause)
