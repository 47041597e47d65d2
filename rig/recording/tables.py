"""From a table of named columns to a run in SI units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from rig.arrays import Array
from rig.recording.checks import check_channel, check_samples, missing_column
from rig.recording.run import Run
from rig.recording.stated_units import column_named, factor_of
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
    """Every quantity that the file has, in SI units, and "valid", each of shape (n,).

    Raises RecordingError for a sample that is said to be valid and is not a number.
    """
    names = _names(table, section)
    values = table.read(list(names.values()))
    columns: dict[str, Array] = {quantity: values[name] for quantity, name in names.items()}
    valid = check_samples(table, columns)
    scaled: dict[str, Array] = {
        q: x if factors[q] == 1.0 else x * factors[q] for q, x in columns.items() if q != "valid"
    }
    return {**scaled, "valid": valid.astype(float)}


def run_of_table(table: Table, factors: Mapping[str, float], entry: RecordedRun, section: RecordedConfig) -> Run:
    """The whole table as a run, not yet checked. Raises RecordingError."""
    columns = columns_of(table, factors, section)
    valid = columns["valid"].astype(bool)
    channels = channels_of(table, section)
    for name, x in channels.items():
        check_channel(table, name, x, len(valid))
    time_s, rate, angle, torque = (columns.get(q) for q in ("time", "rate", "angle", "torque"))
    assert time_s is not None  # _names refuses a table without time
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
    )


def channels_of(table: Table, section: RecordedConfig) -> dict[str, Array]:
    """The further columns, in their channel's unit; a reading may be missing. Raises RecordingError."""
    wanted = section.columns.channels
    named = {name: config.column or name for name, config in wanted.items()}
    for name, column in named.items():
        if column not in table.names:
            raise missing_column(table, f"channels.{name}", [column], mapped=True)
    values = table.read(list(named.values())) if named else {}
    return {name: wanted[name].scale * values[column] for name, column in named.items()}


def _names(table: Table, section: RecordedConfig) -> dict[Quantity, str]:
    """The column of every quantity that the file has."""
    names: dict[Quantity, str] = {}
    for quantity, defaults in DEFAULT_NAMES.items():
        named = getattr(section.columns, quantity)
        name = column_named(table, quantity, named, list(defaults))
        if named is not None and name is None:
            raise missing_column(table, quantity, [named], mapped=True)
        if name is not None:
            names[quantity] = name
    if "time" not in names:
        raise missing_column(table, "time", list(DEFAULT_NAMES["time"]), mapped=False)
    if "rate" not in names and "angle" not in names:
        either = [*DEFAULT_NAMES["rate"], *DEFAULT_NAMES["angle"]]
        raise missing_column(table, "rate", either, mapped=False)
    return names


def factors_of(table: Table, section: RecordedConfig) -> dict[str, float]:
    """The factor to SI units of every quantity that the file has. Raises RecordingError where one is missing."""
    return {quantity: _factor(table, name, section, quantity) for quantity, name in _names(table, section).items()}


def _factor(table: Table, name: str, section: RecordedConfig, quantity: Quantity) -> float:
    """To SI units: the factor given, else that of the unit over the column or of the one that its name stands for."""
    if quantity in section.scale.model_fields_set:
        given: float = getattr(section.scale, quantity)
        return given
    return factor_of(table, name, quantity, section.axis, DEFAULT_NAMES[quantity].get(name))
