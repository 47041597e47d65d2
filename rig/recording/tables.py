"""From a table of named columns to a run in SI units."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Array, Mask
from rig.errors import RecordingError
from rig.recording.checks import check_channel, check_lengths, check_samples, missing_column
from rig.recording.missing import Rows, lost_within, read_between, with_values
from rig.recording.run import Run
from rig.recording.sentinels import in_words, sentinels, without
from rig.recording.stated_units import column_named, factor_of, is_none
from rig.recording.table import Table
from rig.units import DEG

if TYPE_CHECKING:
    from rig.config.recorded import RecordedConfig, RecordedRun

Quantity = Literal["time", "torque", "rate", "angle", "valid"]
# Default names, and the factor to SI units that the name itself stands for.
DEFAULT_NAMES: Mapping[Quantity, Mapping[str, float]] = {
    "time": {"time_s": 1.0},
    "torque": {"torque_nm": 1.0},
    "rate": {"rate_rad_s": 1.0, "rate_deg_s": DEG},
    "angle": {"angle_rad": 1.0, "angle_deg": DEG},
    "valid": {"valid": 1.0},
}


def columns_of(table: Table, factors: Mapping[str, float], section: RecordedConfig) -> dict[str, Array]:
    """Every quantity that rows of a file have, in SI units, and "valid", each of shape (n,).

    A row without a value is lost. Raises RecordingError where a column "valid" says that it is not.
    """
    columns, at = _as_stored(table, section)
    rows, _ = _without_sentinels(Rows(columns, at), table)
    return _checked(table, dataclasses.replace(rows, columns=lost_within(rows.columns)), factors)


def time_of(table: Table, factors: Mapping[str, float], section: RecordedConfig) -> Array:
    """The times in s alone, not checked, shape (n,)."""
    names = _names(table, section)
    if section.sample_rate_hz is not None:
        name = next(iter(names.values()))
        return _even(table, len(table.read([name])[name]), section.sample_rate_hz)
    return table.read([names["time"]])[names["time"]] * factors["time"]


def run_of_table(table: Table, factors: Mapping[str, float], entry: RecordedRun, section: RecordedConfig) -> Run:
    """The table between from_s and to_s as a run, not yet checked.

    Raises RecordingError. What lies outside from_s and to_s may hold anything.
    """
    columns, at = _as_stored(table, section)
    channels = channels_of(table, section)
    for name, x in channels.items():
        check_channel(table, name, x, len(at))
    inside = between(columns["time"] * factors["time"], entry, table.path)
    rows, instead = _without_sentinels(Rows(columns, at).only(inside), table)
    rows = with_values(rows, table)
    if rows.missing and rows.missing.between:
        stamps = columns["time"]
        channels = {name: read_between(stamps, x, stamps[rows.at]) for name, x in channels.items()}
    else:
        channels = {name: x[rows.at] for name, x in channels.items()}
    columns = _checked(table, rows, factors)
    valid = columns["valid"].astype(bool)
    time_s, rate, angle, torque = (columns.get(q) for q in ("time", "rate", "angle", "torque"))
    assert time_s is not None  # _names refuses a table without time or sample rate
    keep = np.isfinite(time_s)  # a lost sample may have lost its time too
    has_torque = None if torque is None else keep & np.isfinite(torque)
    return Run(
        name=table.path.name,
        time_s=time_s[keep],
        valid=valid[keep],
        rate_rad_s=None if rate is None else rate[keep],
        angle_rad=None if angle is None else angle[keep],
        torque_time_s=None if has_torque is None else time_s[has_torque],
        torque_nm=None if torque is None else torque[has_torque],
        torque_hold=section.torque_hold,
        use=entry.use,
        min_rate_rad_s=section.min_rate_of(entry),
        added_inertia_kg_m2=entry.added_inertia_kg_m2,
        channels={name: values[keep] for name, values in channels.items()},
        causes={name: config.channel(name) for name, config in section.columns.channels.items()},
        missing=rows.missing and dataclasses.replace(rows.missing, instead=instead),
        notes=(*table.notes(), *_told_of_channels(table, section), *_counted(section)),
    )


def between(time_s: Array, entry: RecordedRun, path: Path) -> Mask:
    """The samples between from_s and to_s, both included, shape (n,). Raises RecordingError where there is none."""
    if entry.from_s is None and entry.to_s is None:
        return np.ones(len(time_s), dtype=bool)
    start = -math.inf if entry.from_s is None else entry.from_s
    end = math.inf if entry.to_s is None else entry.to_s
    keep = (time_s >= start) & (time_s <= end)
    if not keep.any():
        there = time_s[np.isfinite(time_s)]
        span = f"the file runs from {there.min():g} to {there.max():g} s" if len(there) else "it holds no time"
        raise RecordingError(f"{path}: no sample between from_s = {start:g} and to_s = {end:g}: {span}")
    return keep


def _as_stored(table: Table, section: RecordedConfig) -> tuple[dict[str, Array], NDArray[np.intp]]:
    """Every quantity that the file has, as stored, and the numbers of the rows. Raises RecordingError."""
    names = _names(table, section)
    values = table.read(list(names.values()))
    columns: dict[str, Array] = {quantity: values[name] for quantity, name in names.items()}
    check_lengths(table, columns)
    count = len(next(iter(columns.values())))
    if section.sample_rate_hz is not None:
        columns["time"] = _even(table, count, section.sample_rate_hz)
    return columns, np.arange(count)


def _without_sentinels(rows: Rows, table: Table) -> tuple[Rows, tuple[str, ...]]:
    """The rows without numbers that stand for no reading, and what those are, in words.

    Raises RecordingError where a column "valid" says that such a number counts.
    """
    columns = dict(rows.columns)
    flags = columns.get("valid")
    instead = []
    for quantity in ("torque", "rate", "angle"):
        values = columns.get(quantity)
        if values is None or not (numbers := sentinels(values)):
            continue
        columns[quantity] = without(values, numbers)
        instead.append(f"{in_words(numbers)} as {quantity}")
        counts = np.isin(values, list(numbers)) & (np.zeros(len(values)) if flags is None else flags).astype(bool)
        if counts.any():
            i, largest = int(np.argmax(counts)), float(np.nanmax(np.abs(columns[quantity])))
            raise RecordingError(
                f"{table.path}: {table.label(int(rows.at[i]))}: {quantity} is {values[i]:g} ({counts.sum()} such "
                f"samples), which stands for no reading beside values of up to {largest:g}, but valid is 1: mark the "
                "row valid = 0"
            )
    return dataclasses.replace(rows, columns=columns), tuple(instead)


def _even(table: Table, count: int, sample_rate_hz: float) -> Array:
    """Times in s of rows that a clock took evenly, (count,)."""
    return (table.first_row + np.arange(count)) / sample_rate_hz


def _counted(section: RecordedConfig) -> tuple[str, ...]:
    rate_hz = section.sample_rate_hz
    return () if rate_hz is None else (f"the rows are taken to be evenly spaced, {rate_hz:g} a second",)


def _checked(table: Table, rows: Rows, factors: Mapping[str, float]) -> dict[str, Array]:
    valid = check_samples(table, rows.columns, rows.at, factors)
    scaled: dict[str, Array] = {
        q: x if factors[q] == 1.0 else x * factors[q] for q, x in rows.columns.items() if q != "valid"
    }
    return {**scaled, "valid": valid.astype(float)}


def channels_of(table: Table, section: RecordedConfig) -> dict[str, Array]:
    """The further columns, in their channel's unit; a reading may be missing. Raises RecordingError."""
    wanted = section.columns.channels
    named = {name: config.column or name for name, config in wanted.items()}
    for name, column in named.items():
        if column not in table.names:
            raise missing_column(table, f"channels.{name}", [column], mapped=True)
    values = table.read(list(named.values())) if named else {}
    return {
        name: wanted[name].scale * without(values[column], sentinels(values[column])) for name, column in named.items()
    }


def _told_of_channels(table: Table, section: RecordedConfig) -> list[str]:
    """Which numbers of further columns stand for no reading, in words."""
    named = {name: config.column or name for name, config in section.columns.channels.items()}
    values = table.read(list(named.values())) if named else {}
    found = {name: sentinels(values[column]) for name, column in named.items()}
    return [f"channel {n} has {in_words(x)} for no reading, {sum(x.values())} times" for n, x in found.items() if x]


def _names(table: Table, section: RecordedConfig) -> dict[Quantity, str]:
    """The column of every quantity that the file has."""
    names: dict[Quantity, str] = {}
    for quantity, defaults in DEFAULT_NAMES.items():
        if quantity == "time" and section.sample_rate_hz is not None:
            continue
        named = getattr(section.columns, quantity)
        name = column_named(table, quantity, named, list(defaults))
        if named is not None and name is None and not is_none(table, named):
            raise missing_column(table, quantity, [named], mapped=True)
        if name is not None:
            names[quantity] = name
    if "time" not in names and section.sample_rate_hz is None:
        raise missing_column(table, "time", list(DEFAULT_NAMES["time"]), mapped=False)
    if "rate" not in names and "angle" not in names:
        either = [*DEFAULT_NAMES["rate"], *DEFAULT_NAMES["angle"]]
        raise missing_column(table, "rate", either, mapped=False)
    return names


def factors_of(table: Table, section: RecordedConfig) -> dict[str, float]:
    """The factor to SI units of every quantity that the file has. Raises RecordingError where one is missing."""
    found: dict[str, float] = {q: _factor(table, name, section, q) for q, name in _names(table, section).items()}
    return found if section.sample_rate_hz is None else {**found, "time": 1.0}  # counted, in s


def _factor(table: Table, name: str, section: RecordedConfig, quantity: Quantity) -> float:
    """To SI units: the factor given, else that of the unit over the column or of the one that its name stands for."""
    if quantity in section.scale.model_fields_set:
        given: float = getattr(section.scale, quantity)
        return given
    return factor_of(table, name, quantity, section.axis, DEFAULT_NAMES[quantity].get(name))
