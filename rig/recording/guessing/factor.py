"""The factor from a column's numbers to SI units, and what the file itself says of it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from rig.recording.guessing.columns import Column
from rig.recording.guessing.roles import CURRENT_WORDS, WORDS, Quantity
from rig.units import DIMENSIONS

_AMPERES_OR_VOLTS = re.compile(r"_([AV])$")  # or one of several axes: so it only takes the guess away


@dataclass(frozen=True)
class Factor:
    """How the numbers of a column become SI units.

    Attributes
    ----------
    value
        The factor for ``recorded.scale``; None where none has to be written, because the reader knows the unit.
    why
        In words, with the unit.
    sure
        Whether nobody has to be asked; where not, ``value`` may be None: then there is no guess either.
    """

    value: float | None
    why: str
    sure: bool


def stated_factor(quantity: Quantity, column: Column, axis: str, is_default: bool) -> Factor | None:
    """What the file or the name says; None where neither says anything. ``is_default``: the reader knows the name."""
    dimension = DIMENSIONS[axis][quantity]
    if column.unit is not None and column.unit.dimension == dimension:
        return Factor(None, f"{column.unit.text}, as the file says", True)
    if is_default:
        return Factor(None, "the unit is in its name", True)
    if column.suffix is not None and column.suffix.dimension == dimension:
        return Factor(column.suffix.factor, f"{column.suffix.text}, as its name says", True)
    if column.unit_text or (column.suffix is not None and column.suffix.dimension == "current"):
        what = column.unit_text or "A"
        return Factor(None, f"its numbers are in {what!r}, which is no unit of {dimension} that is known", False)
    return _doubtful(quantity, column, dimension)


def _doubtful(quantity: Quantity, column: Column, dimension: str) -> Factor | None:
    """What a name says against the unit that is usual; None where it says nothing."""
    electrical = _AMPERES_OR_VOLTS.search(column.name)
    if quantity != "time" and electrical is not None:
        what = {"A": "amperes", "V": "volts"}[electrical[1]]
        return Factor(None, f"its name ends in {electrical[0]}, which may be {what} and no unit of {dimension}", False)
    if quantity == "torque" and set(column.words) & CURRENT_WORDS and not set(column.words) & WORDS["torque"]:
        return Factor(None, f"by its name it is a current, which is no {dimension}", False)
    return None
