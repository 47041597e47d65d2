"""How a CSV file is written: encoding, delimiter, decimal sign, names and units of its columns, first data line."""

from __future__ import annotations

import codecs
import gzip
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, cast

from rig.errors import RecordingError
from rig.recording.readers.can_log import is_can_log, undecoded
from rig.recording.readers.text.first_data import first_data, header_above
from rig.recording.readers.text.headings import known_heading
from rig.recording.readers.text.line_fields import decimal_comma, delimiter_of, is_units, split, trimmed
from rig.recording.readers.text.not_a_table import SIDE_HEADER, beside_data, one_value_a_row
from rig.recording.readers.text.preamble import stated_units
from rig.recording.readers.text.timestamps import is_stamp
from rig.recording.readers.text.words import EMPTY, is_number
from rig.recording.readers.text.words import number as number_of
from rig.recording.table import MAX_SAMPLES
from rig.units import bare, unit_of

EXAMPLE_NAMES = ("time_s", "torque_nm", "rate_rad_s")
MAX_LINE_CHARACTERS = 65_536
MAX_TEXT_LINES = MAX_SAMPLES + 1_000_000
MAX_UNPACKED_CHARACTERS = 2 * 1024**3  # a packed file of a few megabytes may unpack to terabytes
MAX_LINES_BEFORE_DATA = 400  # lines, comments and empty ones not counted, in which the data have to begin
COMMENT = ("#", "%", "//")
MIN_ASCII = 0.9  # of the characters of a text whose encoding nothing says
DATA_LINES = 50  # of which the decimal sign is read
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
        return split(text, self.delimiter)

    def number(self, text: str) -> float:
        """A field as a number, empty ones as NaN. Raises ValueError for anything else."""
        return number_of(text, self.decimal_comma)


def layout_of(path: Path) -> Layout:
    """The layout of a file. Raises RecordingError where there is no header or no text, and what reading it raises."""
    encoding = _encoding(path)
    comments, lines = _first_lines(path, encoding)
    if not lines:
        raise RecordingError(f"{path}: holds no data: a header line and one line a sample are needed")
    if is_can_log([text for _, text in lines]):
        raise undecoded(path)
    if (known := known_heading(lines, split)) is not None:
        comma = decimal_comma([text for _, text in lines[known.at : known.at + DATA_LINES]], known.delimiter)
        header = lines[known.at - 1][0] if known.at else lines[0][0] - 1
        return Layout(
            path, encoding, known.names, known.delimiter, comma, header, known.units, known.counted, pairs=known.pairs
        )
    at, delimiter = first_data(lines, comments[-1] if comments else None)
    if beside_data([split(text, delimiter) for _, text in lines]):
        raise RecordingError(f"{path}: {SIDE_HEADER}")
    if at == 0:
        return _without_header(path, encoding, comments, lines, delimiter)
    names_at, units_at = header_above(lines, at, delimiter)
    width = len(trimmed(split(lines[at][1], delimiter))) if at < len(lines) else 0
    names = _names(lines[names_at][1], delimiter, width)
    # Below a row of units a name may be a number: of an oscilloscope's channels.
    is_header = units_at is not None or not any(is_number(name) for name in names)
    if at > 1 and (len(names) != width or not is_header):
        raise RecordingError(
            f"{path}: the data begin in line {lines[at][0]}, and no line above names their {width} columns: add one, "
            "e.g. time (s),torque (N m),rate (deg/s) with the units that these numbers have, and delete what stands "
            "above it"
        )
    if is_stamp(names[0]):
        names[0] = "time_s"  # at which the names were sent
    if why := one_value_a_row(names, [split(text, delimiter) for _, text in lines[at:]]):
        raise RecordingError(f"{path}: {why}")
    above = stated_units([text for _, text in lines[:names_at]], names, lambda text: split(text, delimiter))
    below = {} if units_at is None else _units_of(names, _names(lines[units_at][1], delimiter, width))
    units = above | _without_stamps(below, names, split(lines[at][1], delimiter) if at < len(lines) else [])
    comma = decimal_comma([text for _, text in lines[at : at + DATA_LINES]], delimiter)
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
    for encoding in ("utf-16-le", "utf-16-be") if b"\0" in head else ():
        if _is_text(head, encoding):
            return encoding  # without the mark at the beginning that says so
    if b"\0" in head:
        raise RecordingError(f"{path}: is not a text file, despite its suffix: export the recording as CSV")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)  # the last character may be cut
    except UnicodeDecodeError:
        return "cp1252"  # a degree sign as Windows programs write it
    return "utf-8-sig"


def _is_text(head: bytes, encoding: str) -> bool:
    """Whether bytes with zeros among them are text in an encoding: nearly all of it ASCII, and nothing that steers."""
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return False
    is_plain = all(c.isprintable() or c in "\t\r\n" for c in text)
    return is_plain and sum(c.isascii() for c in text) >= MIN_ASCII * len(text)


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


def _without_header(
    path: Path, encoding: str, comments: Sequence[str], lines: Sequence[tuple[int, str]], delimiter: str | None
) -> Layout:
    """Data from the first line on: numpy.savetxt writes its header as a comment, some add one with the units."""
    line, first = lines[0]
    width = len(split(first, delimiter))
    rows = [_names(comment, delimiter_of(comment), width) for comment in comments[-2:]]
    has_units = len(rows) == 2 and is_units(rows[1]) and len(rows[0]) == len(rows[1]) == width
    names = rows[0] if has_units else rows[-1] if rows else []
    units = _units_of(names, rows[1]) if has_units else {}
    if len(names) != width:
        raise RecordingError(
            f"{path}: line {line} holds numbers where the header has to be: "
            "add a first line that names the columns, with the sign between them that the numbers have, e.g. "
            + (
                "time_s torque_nm rate_rad_s with a tab"
                if delimiter == "\t"
                else (delimiter or " ").join(EXAMPLE_NAMES)
            )
        )
    comma = decimal_comma([text for _, text in lines[:DATA_LINES]], delimiter)
    return Layout(path, encoding, tuple(names), delimiter, comma, line - 1, units)


def _units_of(names: Sequence[str], row: Sequence[str]) -> dict[str, str]:
    """Name -> unit of those that have one in the row of units."""
    return {name: bare(unit) for name, unit in zip(names, row, strict=False) if bare(unit).lower() not in EMPTY}


def _without_stamps(units: Mapping[str, str], names: Sequence[str], first: Sequence[str]) -> dict[str, str]:
    """The units without words over stamps, which are seconds once they are read: the TS of Campbell's loggers."""
    stamps = {name for name, text in zip(names, first, strict=False) if is_stamp(text)}
    return {name: unit for name, unit in units.items() if name not in stamps or unit_of(unit) is not None}


def _names(line: str, delimiter: str | None, width: int) -> list[str]:
    names = trimmed(split(line, delimiter))
    if delimiter is None and width and len(names) != width:  # "torque (N m)" among columns set apart by spaces
        wider = [part.strip() for part in re.split(r"\s{2,}", line.strip())]
        return wider if len(wider) == width else names
    if len(names) == width + 1 and names[-1].lower() == "comment":  # of LabVIEW, in the lines that have one
        names.pop()
    return names
