"""Free disk space, checked before anything moves."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from commands.campaign.announcement import duration_s
from commands.campaign.campaign_part import CampaignPart
from commands.terminal.display import plain
from rig.config.root import Config
from rig.errors import Aborted
from rig.excitation import PlannedSet
from rig.interface import Statement, Torque

START_BYTES = 768 * 1024  # what the journal and the raw capture take before the first set, their reserves included
RESULTS_BYTES = 8_000_000  # the report and what stands beside it
# A tick, as an emulated bench of 1 kHz wrote it: the journal and recording.h5, and raw/ with its exports.
TICK_BYTES, RAW_TICK_BYTES = 220, 330
MEGABYTE = 1e6


def estimated_bytes(config: Config, statement: Statement, sets: Sequence[PlannedSet], part: CampaignPart) -> float:
    """About how many bytes a campaign writes in all."""
    is_bench = statement.torque is not Torque.SIMULATED and config.bench is not None
    bench = config.bench if is_bench else None
    a_tick = TICK_BYTES + (RAW_TICK_BYTES if bench is not None and bench.raw_capture else 0)
    seconds = duration_s(config, sets) + (bench.settle_s if bench is not None else 0.0)
    copied_journals = sum(source.stat().st_size for source, _ in part.copied_journals)
    return RESULTS_BYTES + seconds * config.excitation.sample_rate_hz * a_tick + copied_journals


def disk_space_warning(folder: Path, needed_bytes: float) -> str:
    """What to say of the room that there is for ``folder``; empty where it is enough.

    Raises
    ------
    Aborted
        Where a campaign cannot even begin. Nothing was moved.
    """
    there = next((path for path in (folder, *folder.absolute().parents) if path.is_dir()), None)
    if there is None:
        return ""
    try:
        free = shutil.disk_usage(there).free
    except OSError:  # a file system that does not tell
        return ""
    about = f"{needed_bytes / MEGABYTE:.0f} MB"
    left = f"{free / MEGABYTE:.3g} MB are free in {plain(str(there))}"
    if free < START_BYTES:
        raise Aborted(
            f"{os.strerror(errno.ENOSPC)}: {left}, but this campaign writes about {about} and "
            f"needs {START_BYTES / MEGABYTE:.2g} MB to start. Free space or choose another --out. Nothing was moved."
        )
    if free < needed_bytes:
        return (
            f"DISK      {left}, but this campaign writes about {about}. It will stop with torque off when the "
            "disk is full. Free space or choose another --out."
        )
    return ""
