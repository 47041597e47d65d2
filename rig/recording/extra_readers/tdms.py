"""TDMS of LabVIEW and DIAdem, by nptdms: groups of channels, the time a channel or the increment of a waveform."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.extra_readers.packages import require
from rig.recording.rasters import Group, one_table
from rig.recording.table import Table
from rig.units import NS

UNSET = np.datetime64("1904-01-02")  # LabVIEW's zero, and some hours of a time zone


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where nptdms is missing or the file is damaged."""
    require("nptdms", path, "tdms")
    from nptdms import TdmsFile  # noqa: PLC0415  an extra, and slow to import

    try:
        file = TdmsFile.read(path)
        begins = [at for group in file.groups() for c in group.channels() if (at := _begin(c)) is not None]
        first = min(begins, default=None)
        groups = [one for group in file.groups() for one in _groups(group, first)]
    except Exception as error:
        raise RecordingError(f"{path}: is not a valid TDMS file ({error}): export the recording again") from error
    return [one_table(path, groups)]


def _begin(channel: Any) -> Any:
    """When a waveform begins, as datetime64; None where the file does not say."""
    at = channel.properties.get("wf_start_time")
    if not isinstance(at, np.datetime64) or np.isnat(at) or at <= UNSET:
        return None
    return at.astype("datetime64[ns]")


def _groups(group: Any, first: Any) -> list[Group]:
    """The channels of one TDMS group, by their sampling: waveforms of several rates may stand in one.

    ``first`` is when the first waveform of the file begins; one that does not say when it does begins with it.
    """
    by_sampling: dict[tuple[float, float, int], list[Any]] = {}
    for channel in group.channels():
        properties = channel.properties
        step = float(properties.get("wf_increment", 0.0) or 0.0)
        offset = float(properties.get("wf_start_offset", 0.0) or 0.0)
        begin = _begin(channel)
        offset += 0.0 if begin is None else NS * int((begin - first).astype(np.int64))
        by_sampling.setdefault((step, offset, len(channel)), []).append(channel)
    out = []
    for (step, offset, count), channels in by_sampling.items():
        if count == 0:
            continue
        time_s = offset + step * np.arange(count) if step > 0.0 else None
        columns = {c.name: _values(c) for c in channels}
        units = {c.name: str(u) for c in channels if (u := c.properties.get("unit_string", ""))}
        out.append(Group(group.name, time_s, columns, units))
    return out


def _values(channel: Any) -> Any:
    """The scaled values; time stamps as seconds since the first."""
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":
        return NS * (values.astype("datetime64[ns]") - values.astype("datetime64[ns]")[0]).astype(np.int64)
    return values
