"""A line of text as its fields, and what they are: data, words, units, types of numbers, decimal commas."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence

from rig.recording.readers.text.preamble import is_labelled
from rig.recording.readers.text.timestamps import is_stamp
from rig.recording.readers.text.words import EMPTY, NO_READING, has_points_between, is_number
from rig.units import unit_of

_TYPE = re.compile(r"[fiu][1248]$|(l?real|double|float|single|u?s?d?l?int)\d*$", re.IGNORECASE)  # of a column's numbers
_ARROW = re.compile(r"^(\s*[\d:.,]+) -> ")  # behind the time of day: of Arduino's serial monitor


def delimiter_of(line: str) -> str | None:
    """The sign between the fields of a line; None: white space."""
    return next((mark for mark in (";", "\t", ",", "|") if mark in line), None)


def split(line: str, delimiter: str | None) -> list[str]:
    """The fields of a line, without quotes and the spaces around them; an arrow behind a time of day parts two."""
    if " -> " in line:
        line = _ARROW.sub(rf"\1{delimiter or ' '}", line)
    if delimiter is None:
        return [part.strip().strip('"') for part in line.split()]
    if '"' not in line:
        return [part.strip() for part in line.split(delimiter)]
    return [part.strip() for part in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def trimmed(fields: list[str]) -> list[str]:
    """The same list, without the empty fields at its end."""
    while fields and not fields[-1]:
        fields.pop()
    return fields


def is_reading(field: str) -> bool:
    """Whether a field is a number or a time."""
    return is_number(field) or is_stamp(field)


def is_data(line: str, delimiter: str | None) -> bool:
    """Whether a line is one of numbers, empty fields and time stamps, with at least one number."""
    known = [f for f in split(line, delimiter) if f.lower() not in NO_READING]
    return any(is_number(f) for f in known) and all(is_reading(f) for f in known)


def are_rows_with_words(rows: Sequence[Sequence[str]]) -> bool:
    """Whether all are rows of data: as wide as each other, with two numbers at least, and words always in one place.

    A preamble has words where the data below it have numbers.
    """
    if len({len(row) for row in rows}) != 1 or any(sum(map(is_reading, row)) < 2 for row in rows):
        return False
    columns = ([f for f in column if f.lower() not in NO_READING] for column in zip(*rows, strict=True))
    return all(len({is_reading(f) for f in column}) < 2 for column in columns)


def are_types(fields: Sequence[str]) -> bool:
    """Whether these are the types of numbers, as INCA writes them between names and units."""
    return bool(fields) and all(_TYPE.match(field) for field in fields)


def is_units(fields: Sequence[str]) -> bool:
    """Whether these stand below the names to say their units: no number among them, and one at least a known unit."""
    known = [f for f in fields if f.lower() not in EMPTY]
    if is_labelled(fields) or any(is_number(f) for f in known):
        return False
    return any(unit_of(f) is not None for f in known)


def can_name(fields: Sequence[str]) -> bool:
    """Whether these can be the names of columns: words, none of them empty or repeated."""
    plain = {f.lower() for f in fields}
    return len(plain) == len(fields) and not plain & NO_READING and not any(is_reading(f) for f in fields)


def decimal_comma(data: Sequence[str], delimiter: str | None) -> bool:
    """Whether numbers have a decimal comma: some hold one (in quotes, between commas), none a decimal point.

    The points of a date, a name or a word say nothing of the numbers.
    """
    numbers = [f for line in data for f in split(line, delimiter) if not is_stamp(f) and is_number(f)]
    return any("," in f for f in numbers) and not any("." in f and not has_points_between(f) for f in numbers)
