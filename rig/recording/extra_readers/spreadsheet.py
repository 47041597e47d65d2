"""Workbooks of Excel and LibreOffice (.xlsx, .xls, .ods), by calamine: the first sheet that has rows of numbers."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.extra_readers.packages import require
from rig.recording.readers.text.words import EMPTY, is_number, number
from rig.recording.table import Table, read_each
from rig.units import bare, unit_of

MOST_UNPACKED_BYTES = 1 << 30
MIN_DATA_ROWS = 3  # rows in a row that look like data
MAX_ROWS_BEFORE_DATA = 400  # rows in which the data have to begin
_VALUES = (int, float, date, time, timedelta)  # a datetime is a date, too

Row = Sequence[Any]


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where calamine is missing, the file is damaged, or no sheet has a header."""
    require("python_calamine", path, "xlsx")
    from python_calamine import CalamineWorkbook  # noqa: PLC0415  an extra

    _check_size(path)
    try:
        book = CalamineWorkbook.from_path(str(path))
        sheets = {name: book.get_sheet_by_name(name).to_python(skip_empty_area=False) for name in book.sheet_names}
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a panic of the library is no Exception
        raise RecordingError(f"{path}: is no workbook that can be read ({error}): save it again, or as CSV") from error
    found = {name: at for name, rows in sheets.items() if (at := _first_data(rows)) is not None}
    if not found:
        raise RecordingError(f"{path}: no sheet has rows of numbers: one row a sample below a row of names is needed")
    name, at = next(iter(found.items()))
    others = [repr(other) for other in found if other != name]
    table = _table(path, name, sheets[name], at)
    told = (f"sheet {name!r} is read; {', '.join(others)} too has rows of numbers",) if others else ()
    return [Table(path, table.names, table.read, table.label, table.units, notes=lambda: told)]


def _check_size(path: Path) -> None:
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        return  # an .xls is none; what else is wrong the library says
    if size > MOST_UNPACKED_BYTES:
        raise RecordingError(f"{path}: unpacks to more than {MOST_UNPACKED_BYTES >> 20} MiB: save it as CSV")


def _first_data(rows: Sequence[Row]) -> int | None:
    """The first of some rows of numbers; None where there are none."""
    for at in range(min(len(rows) - MIN_DATA_ROWS + 1, MAX_ROWS_BEFORE_DATA)):
        if all(sum(_is_value(cell) for cell in row) > 1 for row in rows[at : at + MIN_DATA_ROWS]):
            return at
    return None


def _table(path: Path, sheet: str, rows: Sequence[Row], at: int) -> Table:
    above = [row for row in rows[:at] if sum(bool(_text(cell)) for cell in row) > 1]
    if not above:
        raise RecordingError(
            f"{path}: sheet {sheet!r}: row {at + 1} holds numbers, and no row above names their columns: add one, e.g. "
            "time (s), torque (N m), rate (deg/s) with the units that these numbers have"
        )
    names = [_text(cell) for cell in above[-1]]
    units: Mapping[str, str] = {}
    if len(above) > 1 and any(unit_of(bare(name)) for name in names if name):
        said, names = names, [_text(cell) for cell in above[-2]]
        units = {n: bare(u) for n, u in zip(names, said, strict=False) if n and bare(u).lower() not in EMPTY}
    end = max(i for i, row in enumerate(rows) if any(_is_value(cell) for cell in row)) + 1
    data = rows[at:end]
    named = {name: i for i, name in reversed(list(enumerate(names))) if name}

    def column(name: str) -> Any:
        return _numbers(path, sheet, name, [row[named[name]] if named[name] < len(row) else "" for row in data], at)

    ordered = tuple(dict.fromkeys(name for name in names if name))
    return Table(path, ordered, read_each(path, column), lambda index: f"row {at + index + 1}", units)


def _numbers(path: Path, sheet: str, name: str, cells: Sequence[Any], first_row: int) -> Any:
    """The cells of a column as numbers, empty ones NaN, times as seconds since midnight of the first day."""
    # A moment exactly at midnight comes as a date.
    cells = [datetime.combine(c, time()) if isinstance(c, date) and not isinstance(c, datetime) else c for c in cells]
    day = next((cell for cell in cells if isinstance(cell, datetime)), None)
    midnight = None if day is None else datetime(day.year, day.month, day.day)
    out = np.empty(len(cells))
    for i, cell in enumerate(cells):
        if isinstance(cell, datetime) and midnight is not None:
            out[i] = (cell - midnight).total_seconds()
        elif isinstance(cell, timedelta):
            out[i] = cell.total_seconds()
        elif isinstance(cell, time):
            out[i] = 3600.0 * cell.hour + 60.0 * cell.minute + cell.second + 1e-6 * cell.microsecond
        elif isinstance(cell, int | float):
            out[i] = cell
        else:
            try:
                out[i] = number(str(cell), "," in str(cell) and "." not in str(cell))
            except ValueError:
                raise RecordingError(
                    f"{path}: sheet {sheet!r}, row {first_row + i + 1}, column {name!r}: {str(cell)[:40]!r} is no "
                    "number: correct it, or leave it empty"
                ) from None
    return out


def _is_value(cell: Any) -> bool:
    return isinstance(cell, _VALUES) or (isinstance(cell, str) and is_number(cell))


def _text(cell: Any) -> str:
    return cell.strip() if isinstance(cell, str) else "" if isinstance(cell, date | time | timedelta) else str(cell)
