"""ASAM MDF 3 and 4 (.mf4, .mdf), by asammdf: INCA, CANape, Vector and dSPACE recordings, several rates in one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.extra_readers.packages import require
from rig.recording.rasters import Group, one_table
from rig.recording.readers.can_log import undecoded
from rig.recording.table import Table

RAW_CAN = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame")


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where asammdf is missing, the file is damaged or holds raw CAN frames only."""
    require("asammdf", path, "mf4")
    from asammdf import MDF  # noqa: PLC0415  an extra, and slow to import

    try:
        with MDF(path) as file:
            groups = [group for i in range(len(file.groups)) if (group := _group(file, i)).columns]
            raw = any(str(c.name).startswith(RAW_CAN) for g in file.groups for c in g.channels)
    except Exception as error:
        raise RecordingError(f"{path}: is not a valid MDF file ({error}): export the recording again") from error
    if raw and not groups:
        raise undecoded(path, "asammdf: MDF.extract_bus_logging, or in its window Bus logging")
    return [one_table(path, groups)]


def _group(file: Any, index: int) -> Group:
    """The channels of a group that are numbers; readings that the file marks as invalid are NaN."""
    time_s = None
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    master = file.masters_db.get(index)
    for i, channel in enumerate(file.groups[index].channels):
        if i == master or str(channel.name).startswith(RAW_CAN):
            continue
        signal = file.get(group=index, index=i, ignore_invalidation_bits=True)
        values = np.asarray(signal.samples)
        if values.ndim != 1 or values.dtype.kind not in "fiub":
            continue
        if signal.invalidation_bits is not None:
            # As NaN, and not left out: every channel keeps the times of its group.
            values = np.where(np.asarray(signal.invalidation_bits), np.nan, values.astype(float))
        time_s = np.asarray(signal.timestamps, dtype=float)
        columns[signal.name] = values
        if signal.unit:
            units[signal.name] = str(signal.unit)
    name = str(getattr(file.groups[index].channel_group, "acq_name", "") or f"group{index + 1}")
    return Group(name, time_s, columns, units)
