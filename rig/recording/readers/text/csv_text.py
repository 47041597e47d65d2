"""CSV, plain or gzipped: numbers with a decimal point or comma, time stamps, below a header (see ``csv_layout``)."""

from __future__ import annotations

import re
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.readers.paired_times import laid
from rig.recording.readers.status import told_of
from rig.recording.readers.text.csv_layout import COMMENT, Layout, all_lines, layout_of
from rig.recording.readers.text.cut_end import cut_end
from rig.recording.readers.text.headings import COUNTED
from rig.recording.readers.text.lvm_segments import TIME, Segments
from rig.recording.readers.text.thousands import first_grouped, may_be_grouped
from rig.recording.readers.text.timestamps import Stamps, is_stamp
from rig.recording.readers.text.words import NO_READING, is_number
from rig.recording.readers.unreadable import unreadable
from rig.recording.table import MAX_SAMPLES, Table, too_long

ROWS_SEARCHED_FOR_WORDS = 50  # rows in which a column of words shows
ROWS_COMPARED = 1000  # rows of which it is told whether all differ from the header
_WORD = re.compile(r"[^\W\d_]")  # begins with a letter
_DAMAGE = (OSError, EOFError, zlib.error, UnicodeError)


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where there is no header, no text or no data."""
    try:
        layout = layout_of(path)
        cut = cut_end(path, layout.encoding, layout.fields, len(layout.names))
    except _DAMAGE as error:
        raise RecordingError(f"{path}: cannot be read ({error}): export the file again") from error
    text = _Text(layout, bool(cut))

    def notes() -> Sequence[str]:
        said = [f"the last line {cut}, as of a file that was cut, and is left out"] * bool(cut)
        if layout.counted is not None:
            begin_s, step_s = layout.counted
            said.append(f"the rows have no time: by the heading they begin at {begin_s:g} s and are {step_s:g} s apart")
        return said + _told(text)

    paired = [name for pair in layout.pairs for name in pair]
    if paired and (table := laid(path, layout.pairs, _columns(text, paired), layout.units)) is not None:
        return [replace(table, notes=notes)]
    names = tuple(name for name in layout.names if name)
    if layout.counted is not None:
        names = (COUNTED, *(name for name in names if name != COUNTED))
    return [
        Table(
            path,
            names,
            lambda names: _columns(text, names),
            lambda index: f"line {_line_of(text, index)}",
            layout.units,
            notes=notes,
        )
    ]


def _is_word(field: str) -> bool:
    """Whether a field is neither a number, nor a word in its place, nor a time."""
    is_one = bool(_WORD.match(field)) and field.lower() not in NO_READING
    return is_one and not is_number(field) and not is_stamp(field)


@dataclass(frozen=True)
class _Text:
    """The text of a table, and whether its last line is no row."""

    layout: Layout
    is_cut: bool
    segments: Segments = field(default_factory=Segments)


def _told(text: _Text) -> list[str]:
    """What columns of words say of the rows."""
    layout = text.layout
    words: set[int] = set()
    for _, line in islice(_data_lines(text), ROWS_SEARCHED_FOR_WORDS):
        fields = layout.fields(line)[: len(layout.names)]
        words |= {i for i, f in enumerate(fields) if _is_word(f)}
    if not words:
        return []
    rows = ((f"line {number}", layout.fields(line)) for number, line in _data_lines(text))
    return told_of({i: layout.names[i] for i in sorted(words)}, rows)


def _lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Number and text of every line that is neither empty nor a comment."""
    for number, text in all_lines(path, encoding):
        if text and not text.isspace() and not text.lstrip().startswith(COMMENT):
            yield number, text


def _data_lines(text: _Text) -> Iterator[tuple[int, str]]:
    """Number and text of every row; the last line is held back until it is known to be one."""
    layout = text.layout
    held: tuple[int, str] | None = None
    lines = _lines(layout.path, layout.encoding)
    if layout.path.name.lower().endswith(".lvm"):
        rows = text.segments.data_of(lines, layout.header_line)
    else:
        rows = (line for line in lines if line[0] > layout.header_line and line[1] != layout.header)
    for count, row in enumerate(rows, start=1):
        if count > MAX_SAMPLES:
            raise too_long(layout.path, count)
        if held is not None:
            yield held
        held = row
    if held is not None and not text.is_cut:
        yield held


def _columns(text: _Text, names: Sequence[str]) -> Mapping[str, Array]:
    layout = text.layout
    for name in names:
        if layout.names.count(name) > 1:
            raise RecordingError(f"{layout.path}: the header names {name!r} twice: rename one of them")
    written = [name for name in names if layout.counted is None or name != COUNTED]
    # A row is counted by its first column, whichever is wanted.
    positions = [layout.names.index(name) for name in written] or [len(layout.names) - 1]
    try:
        values = _fast(text, positions)
        if values is None:
            values = _careful(text, positions)
    except _DAMAGE as error:
        raise RecordingError(f"{layout.path}: is damaged ({error}): export the file again") from error
    if not len(values):
        raise RecordingError(f"{layout.path}: only a header, no data: export the recording again")
    for i, name in enumerate(written):
        if may_be_grouped(values[:, i]):
            _check_thousands(text, name, positions[i])
    found = {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(written)}
    if layout.counted is not None and COUNTED in names:
        found[COUNTED] = layout.counted[0] + layout.counted[1] * np.arange(len(values))
    if text.segments.rows and TIME in found:
        found[TIME] = text.segments.laid(found[TIME])
    return found


def _check_thousands(text: _Text, name: str, position: int) -> None:
    """Raise RecordingError where a sign between thousands was read as a decimal sign."""
    layout, lines = text.layout, list(_data_lines(text))
    found = first_grouped(layout.fields(line)[position] for _, line in lines)
    if found is not None:
        row, grouped, small = found
        raise RecordingError(
            f"{layout.path}: line {lines[row][0]}, column {name!r}: {grouped!r} beside whole numbers such as "
            f"{small!r}: the {'comma' if ',' in grouped else 'point'} stands between thousands, and would be read as a "
            "decimal sign: export the numbers without a sign between thousands"
        )


def _fast(text: _Text, positions: Sequence[int]) -> Array | None:
    """All rows by NumPy's parser, or None where it stumbles: over empty fields, text, or ragged rows."""
    layout = text.layout
    if layout.decimal_comma and layout.delimiter == ",":
        return None
    lines = (line for _, line in _data_lines(text))
    first = next(lines, None)
    if first is None:
        return np.empty((0, len(positions)))
    width = len(layout.fields(first))
    if width < len(layout.names):
        return None
    rows: Iterator[str] = chain([first], lines)
    if layout.decimal_comma:
        rows = map(_with_points, rows)
    try:
        # Without usecols NumPy also holds every row to the same number of fields.
        whole = width <= len(positions) + 4
        columns = None if whole else positions
        table = np.loadtxt(rows, delimiter=layout.delimiter, comments=None, quotechar='"', ndmin=2, usecols=columns)
    except ValueError:
        return None
    if whole and table.shape[1] != len(layout.names):
        return None
    picked: Array = table[:, positions] if whole else table
    return picked


def _with_points(line: str) -> str:
    """A line with decimal points in the place of commas. Raises ValueError where it has points already."""
    if "." in line:
        raise ValueError(line)
    return line.replace(",", ".")


def _careful(text: _Text, positions: Sequence[int]) -> Array:
    """All rows one by one: slower, but it can say which line is wrong."""
    layout = text.layout
    width = len(layout.names)
    values = array("d")
    count = 0
    stamps: dict[int, Stamps] = {}
    for number, line in _data_lines(text):
        fields = _row(layout, line)
        if len(fields) != width:
            raise RecordingError(_ragged(text, number, len(fields), first=count == 0))
        for i in positions:
            try:
                values.append(_value(layout, fields[i], i, stamps, first=count == 0))
            except ValueError as error:
                cure = unreadable(fields, i, first=count == 0, error=error)
                where = f"{layout.path}: line {number}, column {layout.names[i]!r}"
                raise RecordingError(f"{where}: {fields[i][:40]!r} {cure}") from None
        count += 1
    return np.array(values, dtype=np.float64).reshape(count, len(positions))


def _row(layout: Layout, line: str) -> list[str]:
    """The fields of a row, without empty ones beyond the header's."""
    fields = layout.fields(line)
    while len(fields) > len(layout.names) and not fields[-1]:
        fields.pop()
    return fields


def _value(layout: Layout, text: str, position: int, stamps: dict[int, Stamps], first: bool) -> float:
    """A field as a number; a column whose first field is a time stamp as seconds. Raises ValueError."""
    if position in stamps:
        return stamps[position].seconds(text)
    try:
        return layout.number(text)
    except ValueError:
        if not first:
            raise
        column = Stamps()
        seconds = column.seconds(text)
        stamps[position] = column
        return seconds


def _ragged(text: _Text, number: int, count: int, *, first: bool) -> str:
    """What is said of a row with another number of fields; ``first``: of the data."""
    layout = text.layout
    said = f"{layout.path}: line {number} has {count} fields where the header names {len(layout.names)}"
    if layout.delimiter == "," and count >= 2 * len(layout.names) - 1:
        return f"{said}: with decimal commas, separate the columns by semicolons"
    widths = {len(_row(layout, line)) for _, line in islice(_data_lines(text), ROWS_COMPARED)} if first else set()
    if widths != {count}:
        return f"{said}: complete or delete the line (the last one may be cut)"
    comma = ", or, if a comma stands within a number or a time, separate the columns by semicolons"
    return f"{said}, and so have the others: name every column in the header{comma if layout.delimiter == ',' else ''}"


def _line_of(text: _Text, index: int) -> int:
    for count, (number, _) in enumerate(_data_lines(text)):
        if count == index:
            return number
    return -1
