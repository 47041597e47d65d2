"""Where the data of a text file begin, and which lines above them have the names of the columns and their units."""

from __future__ import annotations

from collections.abc import Sequence

from rig.recording.readers.text.line_fields import (
    are_rows_with_words,
    are_types,
    can_name,
    delimiter_of,
    is_data,
    is_reading,
    is_units,
    split,
    trimmed,
)
from rig.recording.readers.text.preamble import stated_separator
from rig.recording.readers.text.words import is_number

MIN_DATA_LINES = 3  # lines in a row that look like data before a preamble is believed
LINES_WITH_WORDS = 10  # lines in a row, where there are so many, if they have words among the numbers

Lines = Sequence[tuple[int, str]]


def first_data(lines: Lines, comment: str | None) -> tuple[int, str | None]:
    """Where the data begin, 1 where that is not clear, and the delimiter. ``comment``: the one above the first line."""
    plain = delimiter_of(lines[0][1])
    if is_data(lines[0][1], plain) or _is_row_with_words(lines, plain, comment):
        return 0, plain
    if len(lines) == 1:
        return 1, plain
    first = len(trimmed(split(lines[0][1], plain)))
    for at in (1, 2):
        if at >= len(lines) or len(split(lines[at][1], plain)) < first:
            continue
        has_numbers = any(is_number(f) for f in split(lines[at][1], plain))
        if (at == 1 and is_data(lines[1][1], plain)) or (at == 2 and has_numbers and _are_units_above(lines, 2)):
            return at, plain
    stated = stated_separator(lines)
    for is_first in (_is_first, _is_first_with_words):
        for at in range(1, len(lines)):
            delimiter = stated or delimiter_of(lines[at][1])
            if is_first(lines, at, delimiter):
                return (1, plain) if _is_damaged(lines, at, delimiter, first) else (at, delimiter)
    return 1, plain


def _is_row_with_words(lines: Lines, delimiter: str | None, comment: str | None) -> bool:
    """Whether the first line is data with words, which no header stands above, or one behind the sign of a comment.

    Names may be numbers, too, of an oscilloscope's channels; but they are whole then.
    """
    fields = split(lines[0][1], delimiter)
    is_named = comment is not None and len(split(comment, delimiter_of(comment))) == len(fields)
    has_fraction = any(is_reading(f) and not f.lstrip("+-").isdigit() for f in fields)
    return (is_named or has_fraction) and _is_first_with_words(lines, 0, delimiter)


def _is_first(lines: Lines, at: int, delimiter: str | None) -> bool:
    following = [text for _, text in lines[at : at + MIN_DATA_LINES]]
    widths = {len(trimmed(split(text, delimiter))) for text in following}
    return all(is_data(text, delimiter) for text in following) and len(widths) == 1 and max(widths) > 1


def _is_first_with_words(lines: Lines, at: int, delimiter: str | None) -> bool:
    following = [split(text, delimiter) for _, text in lines[at : at + LINES_WITH_WORDS]]
    return len(following) >= MIN_DATA_LINES and are_rows_with_words(following)


def _is_damaged(lines: Lines, at: int, delimiter: str | None, first: int) -> bool:
    """Whether the lines between the first one, which has so many fields, and the data are rows that were damaged.

    Data below lines of another width have a preamble; below one of their own width those before them are damaged,
    unless there are units, or names below other lines.
    """
    if first != len(trimmed(split(lines[at][1], delimiter))) or _are_units_above(lines, at):
        return False
    is_between = any(len(trimmed(split(text, delimiter))) != first for _, text in lines[1 : at - 1])
    names = split(lines[at - 1][1], delimiter)
    return not (is_between and len(names) == first and can_name(names))


def _are_units_above(lines: Lines, at: int) -> bool:
    delimiter = delimiter_of(lines[at][1])
    return at >= 2 and (is_units(split(lines[at - 1][1], delimiter)) or _are_below_units(lines, at, delimiter))


def header_above(lines: Lines, at: int, delimiter: str | None) -> tuple[int, int | None]:
    """Which line before the data has the names, and which below it the units."""
    if at >= len(lines):
        return 0, None
    if at >= 3 and are_types(split(lines[at - 2][1], delimiter)):  # between names and units: of INCA
        return at - 3, at - 1
    if at >= 2 and is_units(last := split(lines[at - 1][1], delimiter)):
        # A column may be called M; then the line before it is no row of names.
        above = split(lines[at - 2][1], delimiter)
        return (at - 2, at - 1) if len(trimmed(above)) >= len(trimmed(last)) else (at - 1, None)
    if _are_below_units(lines, at, delimiter):
        return at - 3, at - 2
    return (at - 1 if at >= 1 else 0), None


def _are_below_units(lines: Lines, at: int, delimiter: str | None) -> bool:
    """Whether words stand between units and data, which say how a column was made: of Campbell's loggers.

    They are repeated, or there are none for some columns: such a line names nothing.
    """
    if at < 3:
        return False
    names, units, words, data = (split(text, delimiter) for _, text in lines[at - 3 : at + 1])
    if not len(names) == len(units) == len(words) == len(data) or any(is_reading(f) for f in words):
        return False
    return is_units(units) and not can_name(words) and can_name(names)
