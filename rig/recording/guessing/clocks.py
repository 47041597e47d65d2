"""Two clocks side by side in one file: a row then holds what was true at different times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rig.arrays import Array
from rig.recording.consistency import usual_step
from rig.recording.guessing.columns import Column
from rig.recording.guessing.factor import stated_factor
from rig.recording.guessing.roles import WORDS, Choice, Quantity, says_time
from rig.recording.guessing.time_unit import time_factor

# Two stamps of the same row differ so: a cheap clock drifts, and the host receives late.
DRIFT = 1e-3
JITTER_S = 0.02
_CHANNELS = (WORDS["torque"] | WORDS["rate"] | WORDS["angle"]) - WORDS["time"]


def with_one_clock(roles: Mapping[Quantity, Choice], columns: Sequence[Column], default: str) -> dict[Quantity, Choice]:
    """The same choices; without a time where another column says another time and nobody said which one holds.

    ``default``: the column whose name alone says that it is in seconds.
    """
    time = roles["time"].column
    if time is None or roles["time"].said or (seconds := _seconds(time, default)) is None:
        return dict(roles)
    for other in columns:
        if other is time or not says_time(other) or (others := _seconds(other, default)) is None:
            continue
        if _differ(seconds, others, _is_of_a_channel(time) or _is_of_a_channel(other)):
            why = (
                f"two clocks that differ, {_span(time, seconds)} and {_span(other, others)}: interpolate the channels "
                "of one at the times of the other and export that, or, if one of them holds for every column"
            )
            return {**roles, "time": Choice(None, why, False)}
    return dict(roles)


def _seconds(column: Column, default: str) -> Array | None:
    """Its numbers in seconds, shape (n,), those that are missing NaN; None where it is no clock that always goes on."""
    values = column.values
    if values is None or not np.all(np.diff(values[np.isfinite(values)]) > 0.0):
        return None
    found = time_factor(column, stated_factor("time", column, "rotary", column.name == default))
    unit = column.known_unit.factor if column.known_unit is not None else 1.0
    if found.value is None and not found.sure:
        return None
    seconds: Array = values * (unit if found.value is None else found.value)
    return seconds


def _differ(one: Array, other: Array, of_a_channel: bool) -> bool:
    both = np.isfinite(one) & np.isfinite(other)
    if both.sum() < 2:
        return True
    offset = other[both] - one[both]
    step, span = usual_step(one), float(np.ptp(one[both]))
    if float(np.ptp(offset)) > JITTER_S + 2.0 * step + DRIFT * span:
        return True
    # A clock that began elsewhere is usual; one that belongs to a channel says that the channel is late.
    return of_a_channel and abs(float(np.median(offset))) > step / 2.0


def _is_of_a_channel(column: Column) -> bool:
    return bool(set(column.words) & _CHANNELS)


def _span(column: Column, seconds: Array) -> str:
    return f"{column.name!r} ({np.nanmin(seconds):.6g} to {np.nanmax(seconds):.6g} s)"
