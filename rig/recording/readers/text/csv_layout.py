"""How a CSV file is written: encoding, preamble, delimiter, decimal sign, header, row of units, first data line."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, cast

from rig.errors import RecordingError
from rig.recording.readers.text.headings import known_heading
from rig.recording.readers.text.preamble import is_labelled, stated_separator, stated_units
from rig.recording.readers.text.timestamps import is_stamp
from rig.recording.readers.text.words import EMPTY, NO_READING, has_points_between, is_number
from rig.recording.readers.text.words import number as number_of
from rig.recording.table import MAX_SAMPLES
from rig.units import bare, unit_of

MAX_LINE_CHARACTERS = 65_536
MAX_TEXT_LINES = MAX_SAMPLES + 1_000_000
MAX_UNPACKED_CHARACTERS = 2 * 1024**3  # a packed file of a few megabytes may unpack to terabytes
MAX_LINES_BEFORE_DATA = 400  # lines, comments and empty ones not counted, in which the data have to begin
COMMENT = ("#", "%", "//")
DATA_LINES = 50  # of which the decimal sign is read
MIN_DATA_LINES = 3  # lines in a row that look like data before a preamble is believed
_TYPE = re.compile(r"[fiu][1248]$|(l?real|double|float|single|u?s?d?l?int)\d*$", re.IGNORECASE)  # of a column's numbers
_SEPARATOR_LINE = re.compile(r'^"?sep=.?"?$', re.IGNORECASE)  # as spreadsheets write it


@dataclass(frozen=True)
class Layout:
    """How a file is written.

    Attributes
    ----------
    delimiter
        None: white space.
    header_line
        The last line before the data: that of the names, or of the units below them.
    units
        Column -> unit, where a row of units stands below the names, or above them in a preamble.
    counted
        First time and step in s, where the heading says them and the rows have no time.
    header
        The line of the names: logs that were put one behind the other repeat it.
    pairs
        The columns of time and channel, where each channel has a time before it.
    """

    path: Path
    encoding: str
    names: tuple[str, ...]
    delimiter: str | None
    decimal_comma: bool
    header_line: int
    units: Mapping[str, str] = field(default_factory=dict)
    counted: tuple[float, float] | None = None
    header: str = ""
    pairs: tuple[tuple[str, str], ...] = ()

    def fields(self, text: str) -> list[str]:
        """The fields of a line."""
        return _split(text, self.delimiter)

    def number(self, text: str) -> float:
        """A field as a number, empty ones as NaN. Raises ValueError for anything else."""
        return number_of(text, self.decimal_comma)


def layout_of(path: Path) -> Layout:
    """The layout of a file. Raises RecordingError where there is no header or no text, and what reading it raises."""
    encoding = _encoding(path)
    comments, lines = _first_lines(path, encoding)
    if not lines:
        raise RecordingError(f"{path}: holds no data: a header line and one line a sample are needed")
    if (known := known_heading(lines, _split)) is not None:
        comma = _decimal_comma([text for _, text in lines[known.at : known.at + DATA_LINES]], known.delimiter)
        header = lines[known.at - 1][0]
        return Layout(
            path, encoding, known.names, known.delimiter, comma, header, known.units, known.counted, pairs=known.pairs
        )
    at, delimiter = _first_data(lines)
    if at == 0:
        return _without_header(path, encoding, comments, lines, delimiter)
    names_at, units_at = _header(lines, at, delimiter)
    width = len(_trimmed(_split(lines[at][1], delimiter))) if at < len(lines) else 0
    names = _names(lines[names_at][1], delimiter, width)
    # Below a row of units a name may be a number: of an oscilloscope's channels.
    is_header = units_at is not None or not any(is_number(name) for name in names)
    if at > 1 and (len(names) != width or not is_header):
        raise RecordingError(
            f"{path}: the data begin in line {lines[at][0]}, and no line above names their {width} columns: add one, "
            "e.g. time (s),torque (N m),rate (deg/s) with the units that these numbers have, and delete what stands "
            "above it"
        )
    above = stated_units([text for _, text in lines[:names_at]], names, lambda text: _split(text, delimiter))
    units = above | _units_of(names, [] if units_at is None else _names(lines[units_at][1], delimiter, width))
    comma = _decimal_comma([text for _, text in lines[at : at + DATA_LINES]], delimiter)
    return Layout(path, encoding, tuple(names), delimiter, comma, lines[at - 1][0], units, header=lines[names_at][1])


def all_lines(path: Path, encoding: str) -> Iterator[tuple[int, str]]:
    """Number and text of every line."""
    with _opened(path) as file:
        # Units in a header may be in any encoding; numbers are ASCII in all of them.
        text_file = io.TextIOWrapper(cast(IO[bytes], file), encoding=encoding, errors="replace")
        number = characters = 0
        while line := text_file.readline(MAX_LINE_CHARACTERS):
            number += 1
            if number > MAX_TEXT_LINES:
                raise RecordingError(
                    f"{path}: more than {MAX_TEXT_LINES} lines (empty ones included), the most that is read: "
                    "split it into runs"
                )
            characters += len(line)
            if characters > MAX_UNPACKED_CHARACTERS:
                raise RecordingError(
                    f"{path}: unpacks to more than {MAX_UNPACKED_CHARACTERS >> 30} GiB: cut it into runs"
                )
            if len(line) == MAX_LINE_CHARACTERS:
                raise RecordingError(
                    f"{path}: line {number} is longer than {MAX_LINE_CHARACTERS} characters: one sample a line"
                )
            yield number, line.rstrip("\r\n")


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
        raise RecordingError(f"{path}: is not a text file, despite its suffix: export the recording as CSV")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the last character may be cut
    except UnicodeDecodeError:
        return "cp1252"  # a degree sign as Windows programs write it
    return "utf-8-sig"


def _first_lines(path: Path, encoding: str) -> tuple[list[str], list[tuple[int, str]]]:
    """The comments before the first line, and the lines that are neither empty nor comments."""
    comments, lines = list[str](), list[tuple[int, str]]()
    for number, text in all_lines(path, encoding):
        if not text.strip() or _SEPARATOR_LINE.match(text.strip()):
            continue
        if text.lstrip().startswith(COMMENT):
            comments += [] if lines else [text.lstrip().lstrip("#%/").strip()]
            continue
        lines.append((number, text))
        if len(lines) == MAX_LINES_BEFORE_DATA:
            break
    return comments, lines


def _first_data(lines: Sequence[tuple[int, str]]) -> tuple[int, str | None]:
    """Where the data begin, 1 where that is not clear, and the delimiter."""
    plain = _delimiter(lines[0][1])
    if _is_data(lines[0][1], plain) or len(lines) == 1:
        return (0 if _is_data(lines[0][1], plain) else 1), plain
    first = len(_trimmed(_split(lines[0][1], plain)))
    for at in (1, 2):
        if at >= len(lines) or len(_split(lines[at][1], plain)) < first:
            continue
        has_numbers = any(is_number(f) for f in _split(lines[at][1], plain))
        if (at == 1 and _is_data(lines[1][1], plain)) or (at == 2 and has_numbers and _units_below(lines, 2)):
            return at, plain
    stated = stated_separator(lines)
    for at in range(1, len(lines)):
        delimiter = stated or _delimiter(lines[at][1])
        following = [text for _, text in lines[at : at + MIN_DATA_LINES]]
        widths = {len(_trimmed(_split(text, delimiter))) for text in following}
        if all(_is_data(text, delimiter) for text in following) and len(widths) == 1 and max(widths) > 1:
            break
    else:
        return 1, plain
    # Data below lines of another width have a preamble; below one of their own width those before them are damaged.
    is_damaged = first == len(_trimmed(_split(lines[at][1], plain))) and not _units_below(lines, at)
    return (1, plain) if is_damaged else (at, delimiter)


def _are_types(fields: Sequence[str]) -> bool:
    return bool(fields) and all(_TYPE.match(field) for field in fields)


def _units_below(lines: Sequence[tuple[int, str]], at: int) -> bool:
    return at >= 2 and _is_units(_split(lines[at - 1][1], _delimiter(lines[at][1])))


def _header(lines: Sequence[tuple[int, str]], at: int, delimiter: str | None) -> tuple[int, int | None]:
    """Which line before the data has the names, and which below it the units."""
    if at >= len(lines):
        return 0, None
    if at >= 3 and _are_types(_split(lines[at - 2][1], delimiter)):  # between names and units: of INCA
        return at - 3, at - 1
    if at >= 2 and _is_units(last := _split(lines[at - 1][1], delimiter)):
        # A column may be called M; then the line before it is no row of names.
        above = _split(lines[at - 2][1], delimiter)
        return (at - 2, at - 1) if len(_trimmed(above)) >= len(_trimmed(last)) else (at - 1, None)
    return (at - 1 if at >= 1 else 0), None


def _without_header(
    path: Path, encoding: str, comments: Sequence[str], lines: Sequence[tuple[int, str]], delimiter: str | None
) -> Layout:
    """Data from the first line on: numpy.savetxt writes its header as a comment, some add one with the units."""
    line, first = lines[0]
    rows = [_split(comment, _delimiter(comment)) for comment in comments[-2:]]
    width = len(_split(first, delimiter))
    has_units = len(rows) == 2 and _is_units(rows[1]) and len(rows[0]) == len(rows[1]) == width
    names = rows[0] if has_units else rows[-1] if rows else []
    units = _units_of(names, rows[1]) if has_units else {}
    if len(names) != width:
        raise RecordingError(
            f"{path}: line {line} holds numbers where the header has to be: "
            "add a first line that names the columns, e.g. time_s,torque_nm,rate_rad_s"
        )
    comma = _decimal_comma([text for _, text in lines[:DATA_LINES]], delimiter)
    return Layout(path, encoding, tuple(names), delimiter, comma, line - 1, units)


def _units_of(names: Sequence[str], row: Sequence[str]) -> dict[str, str]:
    """Name -> unit of those that have one in the row of units."""
    return {name: bare(unit) for name, unit in zip(names, row, strict=False) if bare(unit).lower() not in EMPTY}


def _names(line: str, delimiter: str | None, width: int) -> list[str]:
    names = _trimmed(_split(line, delimiter))
    if delimiter is None and width and len(names) != width:  # "torque (N m)" among columns set apart by spaces
        wider = [part.strip() for part in re.split(r"\s{2,}", line.strip())]
        return wider if len(wider) == width else names
    if len(names) == width + 1 and names[-1].lower() == "comment":  # of LabVIEW, in the lines that have one
        names.pop()
    return names


def _trimmed(fields: list[str]) -> list[str]:
    while fields and not fields[-1]:
        fields.pop()
    return fields


def _delimiter(line: str) -> str | None:
    return next((mark for mark in (";", "\t", ",", "|") if mark in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return [part.strip().strip('"') for part in line.split()]
    if '"' not in line:
        return [part.strip() for part in line.split(delimiter)]
    return [part.strip() for part in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _is_data(line: str, delimiter: str | None) -> bool:
    """Whether a line is one of numbers, empty fields and time stamps, with at least one number."""
    fields = _split(line, delimiter)
    known = [f for f in fields if f.lower() not in NO_READING]
    return any(is_number(f) for f in known) and all(is_number(f) or is_stamp(f) for f in known)


def _is_units(fields: Sequence[str]) -> bool:
    """Whether these stand below the names to say their units: no number among them, and one at least a known unit."""
    known = [f for f in fields if f.lower() not in EMPTY]
    if is_labelled(fields) or any(is_number(f) for f in known):
        return False
    return any(unit_of(f) is not None for f in known)


def _decimal_comma(data: Sequence[str], delimiter: str | None) -> bool:
    """Whether numbers have a decimal comma: some fields hold one (in quotes, between commas), none a decimal point."""
    fields = [f for line in data for f in _split(line, delimiter) if not is_stamp(f)]
    return any("," in f for f in fields) and not any("." in f and not has_points_between(f) for f in fields)
