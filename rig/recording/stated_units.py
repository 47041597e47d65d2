"""The unit that a file states over a column: which column a quantity is, and the factor to SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Literal

from rig.errors import RecordingError
from rig.recording.table import Table
from rig.signals import NO_COLUMN
from rig.units import DIMENSIONS, SI, bare, name_and_unit, unit_of

# What a column with a unit over it may be called, besides the default names, which carry theirs.
_PLAIN_NAMES = {
    "time": ("time", "t"),
    "torque": ("torque", "force"),
    "rate": ("rate", "speed"),
    "angle": ("angle", "position"),
    "valid": ("valid",),
}


# How a time of day is written, and no unit: its stamps are seconds once they are read.
_CLOCK = re.compile(r"([dDmMyY]+[-./ ]){0,3}T?[hH]{1,2}:[mM]{1,2}(:[sS]{1,2}([.,:][sSfFzZ0m]+)?)?$")
_CURE = re.compile(r"(recorded\.scale\.(time|torque|rate|angle): )([-\d.e]+)")


def stated_unit(table: Table, column: str) -> str:
    """What stands as the unit of a column, in its name or below it, or is all of its name; empty where nothing does."""
    found = table.units.get(column) or name_and_unit(column)[1] or (bare(column) if _is_bare_unit(column) else "")
    return "" if _CLOCK.match(found) else found


def _is_bare_unit(column: str) -> bool:
    """A header that has units and no names: [s], [N m]."""
    return bare(column) != column.strip() and unit_of(column) is not None


def column_named(table: Table, quantity: str, named: str | None, defaults: Sequence[str]) -> str | None:
    """The column of a quantity, None where there is none.

    ``named`` is what the configuration calls it, with or without the unit that the file has behind the name. Where it
    calls it nothing: one of ``defaults``, else a plain name with a unit over it; where it says "none", nothing.
    """
    if is_none(table, named):
        return None
    if named is not None:
        return named if named in table.names else _only(table, (named,), any_case=False)
    default = next((name for name in defaults if name in table.names), None)
    return default or _only(table, _PLAIN_NAMES[quantity], any_case=True)


def is_none(table: Table, named: str | None) -> bool:
    """Whether the configuration says that a quantity is not to be read, and not that its column is called "none"."""
    return named == NO_COLUMN and NO_COLUMN not in table.names


def _only(table: Table, plain: Sequence[str], *, any_case: bool) -> str | None:
    """The one column of such a name that has a unit; None where there are several or none."""
    found = []
    for column in table.names:
        name = name_and_unit(column)[0]
        if (name.lower() if any_case else name) in plain and stated_unit(table, column):
            found.append(column)
    return found[0] if len(found) == 1 else None


def factor_of(
    table: Table, column: str, quantity: str, axis: Literal["rotary", "linear"], by_name: float | None
) -> float:
    """The factor to SI units that the unit over a column says; ``by_name``, or 1, where there is no unit.

    Raises
    ------
    RecordingError
        For a unit that is not known or measures something else, and where name and unit contradict each other.
    """
    text = stated_unit(table, column)
    if not text or quantity == "valid":
        return 1.0 if by_name is None else by_name
    dimension = DIMENSIONS[axis][quantity]
    unit, si = unit_of(text), SI[dimension]
    where = f"{table.path}: column {column!r}"
    cure = f"set recorded.scale.{quantity} to the factor from the column's numbers to {si} (1 if they are in {si})"
    if unit is None:
        raise RecordingError(f"{where} is in {text[:40]!r}, a unit that is not known: {cure}")
    other: Literal["rotary", "linear"] = "linear" if axis == "rotary" else "rotary"
    if unit.dimension == DIMENSIONS[other][quantity] != dimension:
        cure = f"set recorded.axis: {other}; or {cure}"
    if unit.dimension != dimension:
        raise RecordingError(f"{where} is in {text!r}, a unit of {unit.dimension} and not of {dimension}: {cure}")
    if by_name is not None and not math.isclose(by_name, unit.factor, rel_tol=1e-9):
        raise RecordingError(
            f"{where} has one unit in its name and another, {text!r}, stated with it: correct one of them, or {cure}"
        )
    return unit.factor


def with_factors_in_place(message: str, factors: Mapping[str, float]) -> str:
    """The message of a check of SI values with its factors for the column as stored.

    A factor under ``recorded.scale`` takes the place of the one that was applied and is not multiplied by it.
    """
    changed = {quantity: factor for quantity, factor in factors.items() if factor != 1.0}
    return _CURE.sub(lambda m: f"{m[1]}{float(m[3]) * changed[m[2]]:.6g}" if m[2] in changed else m.group(), message)
