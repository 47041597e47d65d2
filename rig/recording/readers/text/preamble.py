"""What the lines above the header of a text file say of the columns: the separator, the units."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from rig.units import name_and_unit

_STATED_SEPARATOR = re.compile(r"^Separator\s+(Tab|Comma|Semicolon)", re.IGNORECASE)
# The first field of a line above the header whose others are, column by column, the units: LabVIEW's, oscilloscopes'.
_UNITS_OF_COLUMNS = frozenset({"y_unit_label", "vertical units", "vertical unit"})
_UNIT_OF_TIME = frozenset({"horizontal units", "horizontal unit"})  # the next field is that of the first column
_DIMENSION_OF_TIME = "x_dimension"  # LabVIEW counts a dimension called Time in seconds
_NOTHING = ("", "na", "n/a", "none", "-")


def stated_separator(lines: Sequence[tuple[int, str]]) -> str | None:
    """What a LabVIEW measurement file says of itself."""
    found = next((m for _, text in lines[:40] if (m := _STATED_SEPARATOR.match(text))), None)
    return {"tab": "\t", "comma": ",", "semicolon": ";"}[found[1].lower()] if found else None


def is_labelled(fields: Sequence[str]) -> bool:
    """Whether a line says by its first field that the units follow: it is no row of units below names."""
    return bool(fields) and _plain(fields[0]) in _UNITS_OF_COLUMNS | _UNIT_OF_TIME


def _plain(label: str) -> str:
    return label.lower().rstrip(" :")


def stated_units(above: Sequence[str], names: Sequence[str], split: Callable[[str], list[str]]) -> dict[str, str]:
    """Column -> unit, as the lines ``above`` that of the ``names`` say; a unit behind a name is nearer, and holds."""
    found: dict[str, str] = {}
    for line in above:
        label, *fields = split(line) or [""]
        label = _plain(label)
        if label in _UNITS_OF_COLUMNS:
            found |= dict(zip(names[1:], fields, strict=False))
        elif label in _UNIT_OF_TIME and fields and names:
            found[names[0]] = fields[0]
        elif label == _DIMENSION_OF_TIME and fields and fields[0].lower() == "time" and names:
            found[names[0]] = "s"
    return {n: unit for n, unit in found.items() if n and unit.lower() not in _NOTHING and not name_and_unit(n)[1]}
