"""Text in which a time stands before each channel: channels of several rates, laid as those of other formats are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rig.arrays import Array
from rig.recording.rasters import Group, one_table
from rig.recording.table import Table
from rig.units import unit_of


def laid(
    path: Path, pairs: Sequence[tuple[str, str]], columns: Mapping[str, Array], units: Mapping[str, str]
) -> Table | None:
    """The channels of all pairs (time, channel) as one table; None where all have the same times.

    A shorter channel has empty fields at its end.
    """
    groups: dict[bytes, Group] = {}
    for i, (time, channel) in enumerate(pairs):
        unit = unit_of(units.get(time, "s"))
        there = ~np.isnan(columns[time])
        time_s = columns[time][there] * (1.0 if unit is None else unit.factor)
        own = {channel: units[channel]} if channel in units else {}
        key = time_s.tobytes()
        known = groups.get(key, Group(f"group{i + 1}", time_s, {}))
        values = {**known.columns, channel: columns[channel][there]}
        groups[key] = Group(known.name, time_s, values, {**known.units, **own})
    return None if len(groups) < 2 else one_table(path, list(groups.values()))
