"""Channels that a file samples at several rates, as the columns of one table.

The table has the times of the slowest group that is a measurement: one that is at least a tenth as fast as the fastest
and of which the units do not say that it is neither torque nor motion. Other groups are read between their samples by
straight lines: a faster one loses readings, and a slower one (a thermometer) is joined. No group of a measurement is
filled up: readings that were never taken would pass for evidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long
from rig.units import unit_of

MIN_GROUP_RATE_RATIO = 0.1  # of the fastest group's samples: below, a group is a thermometer or a state
MOTION = frozenset(
    {"torque", "force", "rate", "speed", "angle", "length", "current", "voltage"}
)  # a drive's, a sensor's
MIN_GROUP_SAMPLES = 10  # samples that make a group


@dataclass(frozen=True)
class Group:
    """Channels that are sampled together.

    Attributes
    ----------
    name
        Of the group, in front of a channel's where two groups have one of the same name.
    time_s
        Shape (n,), increasing; None where the file says nothing of the time.
    columns
        Channel -> values, each of shape (n,).
    units
        Channel -> unit, where the file states one.
    """

    name: str
    time_s: Array | None
    columns: Mapping[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)

    def has_times_of(self, other: Group) -> bool:
        """Whether both were sampled at the same times."""
        return self.time_s is not None and other.time_s is not None and np.array_equal(self.time_s, other.time_s)

    @property
    def may_be_motion(self) -> bool:
        """Whether one of its channels may be a torque or a motion: unless the units of all say something else."""
        units = [unit_of(self.units.get(name, "")) for name in self.columns]
        return any(unit is None or unit.dimension in MOTION for unit in units)


def one_table(path: Path, groups: Sequence[Group]) -> Table:
    """All channels of a file as one table; with a time, its column is called ``time_s`` (see the module).

    Raises RecordingError where no group has samples.
    """
    timed = [g for g in groups if _is_timed(g)]
    used = timed or [g for g in groups if g.columns]
    if not used:
        raise RecordingError(
            f"{path}: holds no group of channels with {MIN_GROUP_SAMPLES} samples: export the recording again, or "
            "as CSV"
        )
    base = base_of(timed) or max(used, key=lambda g: max(len(v) for v in g.columns.values()))
    if base.time_s is not None and len(base.time_s) > MAX_SAMPLES:
        raise too_long(path, len(base.time_s))
    columns: dict[str, Any] = {}
    units: dict[str, str] = {}
    if base.time_s is not None:
        columns["time_s"] = base.time_s - base.time_s[0]
    names = [name for g in used for name in g.columns]
    for group in used:
        for name, values in group.columns.items():
            free = name not in columns and names.count(name) == 1
            column = name if free else f"{group.name}.{name}"
            columns[column] = at_times_of(base, group, np.asarray(values))
            if name in group.units:
                units[column] = group.units[name]
    return Table(path, tuple(columns), read_each(path, columns.__getitem__), units=units)


def base_of(groups: Sequence[Group]) -> Group | None:
    """The slowest group that is a measurement (see the module); None where none has a time."""
    timed = [g for g in groups if _is_timed(g)]
    if not timed:
        return None
    timed = [g for g in timed if g.may_be_motion] or timed
    rates = [len(g.time_s) / _lasts_s(g) for g in timed if g.time_s is not None]
    measured = [(rate, i) for i, rate in enumerate(rates) if rate >= MIN_GROUP_RATE_RATIO * max(rates)]
    return timed[min(measured)[1]]


def at_times_of(base: Group, group: Group, values: Any) -> Any:
    """A channel at the times of ``base``, NaN outside of its own; what is no plain column is left to the check."""
    if group is base or group.time_s is None or base.time_s is None:
        return values
    if group.has_times_of(base) or values.ndim != 1 or values.dtype.kind not in "fiub":
        return values
    if len(values) != len(group.time_s):
        return values
    return np.interp(base.time_s, group.time_s, values.astype(float), left=np.nan, right=np.nan)


def _is_timed(group: Group) -> bool:
    return group.time_s is not None and len(group.time_s) >= MIN_GROUP_SAMPLES and _lasts_s(group) > 0.0


def _lasts_s(group: Group) -> float:
    assert group.time_s is not None
    return float(group.time_s[-1] - group.time_s[0])
