"""What is the matter with a field of a text file that is no number, and what to do about it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from rig.recording.readers.text.timestamps import AmbiguousDateError

_HAS_NUMBER = re.compile(r"[-+]?[.,]?\d")
_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}$|\d{1,2}-[A-Za-z]{3}-\d{4}$")
_WITH_UNIT = re.compile(r"[-+]?\d+([.,]\d+)?\s*[^\W\d_]\D*$|[-+]?\d+([.,]\d+)?\s*[°%]\D*$")
_SIGNS = re.compile(r"[-+]?\d[\d.,]*$")  # a point where the file has decimal commas
_LOST = "correct it, or leave it empty and add a column valid that is 0 there"

_AMBIGUOUS = (
    "may be a date with the day first or with the month first, and the dates of this file do not tell which: write the "
    "date as 2024-12-31 or 31.12.2024"
)
_STAMP = (
    "is a date or time of a form that is not known: write it as 2024-12-31 23:59:59.123, as 23:59:59.123, or in seconds"
)
_DAY = "is a date without a time of day: leave the column out, or write date and time into one column"
_ROW_OF_UNITS = (
    "is not a number, nor is anything in this line: a row of units that are not known? delete it, or begin it with #"
)


def unreadable(fields: Sequence[str], at: int, *, first: bool, error: ValueError) -> str:
    """Cause and cure, as the end of a sentence that names the field; ``first``: in the first line of the data."""
    field = fields[at].strip()
    is_alone = first and not any(_HAS_NUMBER.match(f.strip()) for f in fields)
    causes = (
        (isinstance(error, AmbiguousDateError), _AMBIGUOUS),
        (":" in field, _STAMP),
        (bool(_DATE.match(field)), _DAY),
        (is_alone, _ROW_OF_UNITS),
        (
            "," in field or bool(_SIGNS.match(field)),
            "is not a number: use one decimal sign in the whole file, and no sign between thousands",
        ),
        (
            bool(_WITH_UNIT.match(field)),
            "is a number with a unit: export numbers alone, the unit in the header: M (N m)",
        ),
    )
    return next((text for holds, text in causes if holds), f"is not a number: {_LOST}")
