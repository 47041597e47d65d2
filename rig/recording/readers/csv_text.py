"""CSV, plain or gzipped: a header line, one delimiter, decimal point or decimal comma, comments with #."""

from __future__ import annotations

import csv
import gzip
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, cast

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.readers.base import MAX_SAMPLES, Table, too_long

MAX_LINE_CHARACTERS = 65_536
MAX_LINES = MAX_SAMPLES + 1_000_000
MAX_CHARACTERS = 2 * 1024**3  # a packed file of a few megabytes may unpack to terabytes
_EMPTY = ("", "na", "n/a", "null", "none", "-")
_DAMAGE = (OSError, EOFError, zlib.error, UnicodeError)


@dataclass(frozen=True)
class Layout:
    """How a file is written: names, delimiter (None: white space), and the line its data begin on."""

    path: Path
    encoding: str
    names: tuple[str, ...]
    delimiter: str | None
    decimal_comma: bool
    header_line: int

    def fields(self, text: str) -> list[str]:
        return _split(text, self.delimiter)

    def number(self, text: str) -> float:
        """A field as a number, empty ones as NaN. Raises ValueError for anything else."""
        text = text.strip()
        if text.lower() in _EMPTY:
            return float("nan")
        if "_" in text:
            raise ValueError(text)
        return float(text.replace(",", ".") if self.decimal_comma else text)


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where there is no header, no text or no data."""
    try:
        layout = _layout(path, _encoding(path))
    except _DAMAGE as error:
        raise RecordingError(f"{path}: cannot be read ({error}): export the file again") from error

    def columns(names: Sequence[str]) -> Mapping[str, Array]:
        return _columns(layout, names)

    return [Table(path, layout.names, columns, lambda index: f"line {_line_of(layout, index)}")]


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    with cast(IO[bytes], gzip.open(path) if path.name.lower().endswith(".gz") else path.open("rb")) as file:
        yield file


def _encoding(path: Path) -> str:
    with _opened(path) as file:
        head = file.read(4096)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if b"\0" in head:
        raise RecordingError(f"{path}: is not text, whatever its suffix says: export the recording as CSV")
    return "utf-8-sig"


def _lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Number and text of every line that is neither empty nor a comment."""
    for number, text in _all_lines(path, encoding):
        if text and not text.isspace() and not text.lstrip().startswith("#"):
            yield number, text


def _all_lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    import io  # noqa: PLC0415

    with _opened(path) as file:
        # Units in a header may be in any encoding; numbers are ASCII in all of them.
        text_file = io.TextIOWrapper(cast(IO[bytes], file), encoding=encoding, errors="replace")
        number = characters = 0
        while line := text_file.readline(MAX_LINE_CHARACTERS):
            number += 1
            if number > MAX_LINES:
                raise RecordingError(f"{path}: more than {MAX_LINES} lines, empty ones counted: is it a recording?")
            characters += len(line)
            if characters > MAX_CHARACTERS:
                raise RecordingError(f"{path}: unpacks to more than {MAX_CHARACTERS >> 30} GiB: cut it into runs")
            if len(line) == MAX_LINE_CHARACTERS:
                raise RecordingError(
                    f"{path}: line {number} is longer than {MAX_LINE_CHARACTERS} characters: one sample a line"
                )
            yield number, line.rstrip("\r\n")


def _layout(path: Path, encoding: str) -> Layout:
    comment = ""
    lines: list[tuple[int, str]] = []
    for number, text in _all_lines(path, encoding):
        if not text.strip():
            continue
        if text.lstrip().startswith("#"):
            comment = comment if lines else text.lstrip().lstrip("#").strip()
            continue
        lines.append((number, text))
        if len(lines) == 2:
            break
    if not lines:
        raise RecordingError(f"{path}: holds no data: a header line and one line a sample are needed")
    delimiter = _delimiter(lines[0][1])
    header_line, header = lines[0]
    if _all_numbers(_split(header, delimiter)):
        # numpy.savetxt writes its header as a comment.
        if len(_split(comment, _delimiter(comment))) != len(_split(header, delimiter)) or not comment:
            raise RecordingError(
                f"{path}: line {header_line} holds numbers where the header has to be: "
                "add a first line that names the columns, e.g. time_s,torque_nm,rate_rad_s"
            )
        header, header_line, first = comment, header_line - 1, lines[0][1]
        names = _split(header, _delimiter(comment))
    else:
        names = _split(header, delimiter)
        first = lines[1][1] if len(lines) > 1 else ""
    while names and not names[-1]:
        names.pop()
    comma = delimiter != "," and "," in first and "." not in first
    return Layout(path, encoding, tuple(names), delimiter, comma, header_line)


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (";", "\t", ",") if mark in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return [part.strip().strip('"') for part in line.split()]
    if '"' not in line:
        return [part.strip() for part in line.split(delimiter)]
    return [part.strip() for part in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _all_numbers(fields: Sequence[str]) -> bool:
    try:
        [float(field.replace(",", ".")) for field in fields if field]
    except ValueError:
        return False
    return True


def _data_lines(layout: Layout) -> Iterator[tuple[int, str]]:
    count = 0
    for number, text in _lines(layout.path, layout.encoding):
        if number > layout.header_line:
            count += 1
            if count > MAX_SAMPLES:
                raise too_long(layout.path, count)
            yield number, text


def _columns(layout: Layout, names: Sequence[str]) -> Mapping[str, Array]:
    for name in names:
        if layout.names.count(name) > 1:
            raise RecordingError(f"{layout.path}: the header names {name!r} twice: rename one of them")
    positions = [layout.names.index(name) for name in names]
    try:
        values = _fast(layout, positions)
        if values is None:
            values = _careful(layout, positions)
    except _DAMAGE as error:
        raise RecordingError(f"{layout.path}: is damaged ({error}): export the file again") from error
    if not len(values):
        raise RecordingError(f"{layout.path}: only a header, no data: export the recording again")
    return {name: np.ascontiguousarray(values[:, i]) for i, name in enumerate(names)}


def _fast(layout: Layout, positions: Sequence[int]) -> Array | None:
    """All rows by NumPy's parser, or None where it stumbles: over empty fields, text, or ragged rows."""
    lines = (text for _, text in _data_lines(layout))
    if layout.decimal_comma:
        lines = (text.replace(",", ".") for text in lines)
    first = next(lines, None)
    if first is None:
        return np.empty((0, len(positions)))
    width = len(layout.fields(first))
    if width < len(layout.names):
        return None

    def rows() -> Iterator[str]:
        yield first
        yield from lines

    try:
        # Without usecols NumPy also holds every row to the same number of fields.
        whole = width <= len(positions) + 4
        columns = None if whole else positions
        table = np.loadtxt(rows(), delimiter=layout.delimiter, comments=None, quotechar='"', ndmin=2, usecols=columns)
    except ValueError:
        return None
    if whole and table.shape[1] != len(layout.names):
        return None
    picked: Array = table[:, positions] if whole else table
    return picked


def _careful(layout: Layout, positions: Sequence[int]) -> Array:
    """All rows one by one: slower, but it can say which line is wrong."""
    width = len(layout.names)
    values = array("d")
    count = 0
    for number, text in _data_lines(layout):
        fields = layout.fields(text)
        while len(fields) > width and not fields[-1]:
            fields.pop()
        if len(fields) != width:
            raise RecordingError(_ragged(layout, number, len(fields)))
        try:
            values.extend([layout.number(fields[i]) for i in positions])
        except ValueError:
            raise RecordingError(_not_a_number(layout, number, fields, positions, count)) from None
        count += 1
    return np.array(values, dtype=np.float64).reshape(count, len(positions))


def _ragged(layout: Layout, number: int, count: int) -> str:
    text = f"{layout.path}: line {number} has {count} fields where the header names {len(layout.names)}: "
    if layout.delimiter == "," and count >= 2 * len(layout.names) - 1:
        return text + "with decimal commas, separate the columns by semicolons"
    return text + "complete or delete the line (the last one may be cut)"


def _not_a_number(layout: Layout, number: int, fields: Sequence[str], positions: Sequence[int], row: int) -> str:
    for i in positions:
        try:
            layout.number(fields[i])
        except ValueError:
            break
    text = f"{layout.path}: line {number}, column {layout.names[i]!r}: {fields[i][:40]!r} is not a number: "
    if row == 0:
        return text + "a row of units? delete it, or begin it with #"
    if "," in fields[i]:
        return text + "use one decimal sign in the whole file"
    return text + "correct it, or leave it empty and add a column valid that is 0 there"


def _line_of(layout: Layout, index: int) -> int:
    for count, (number, _) in enumerate(_data_lines(layout)):
        if count == index:
            return number
    return -1
