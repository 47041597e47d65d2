"""JSON as loggers and scripts write it: an object a line, a list of objects, or an object of lists."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.errors import RecordingError
from rig.recording.readers.text.timestamps import Stamps, is_stamp
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long

MOST_NAMES = 1000  # of a record: more is no record of a few quantities
LINES = (".jsonl", ".ndjson")


def read(path: Path) -> Sequence[Table]:
    """One table: a row an object, its keys the columns, with a dot between those of nested objects.

    What a record lacks, or has as null, is NaN. Raises RecordingError where the file is no such JSON.
    """
    cut: list[str] = []
    try:
        by_line = path.name.lower().endswith(LINES)
        records, numbers = _by_line(path, cut) if by_line else _whole(path)
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{path}: cannot be read as text ({error}): export the recording again") from error
    columns = _columns(path, records)

    def column(name: str) -> Any:
        return _numbers(path, name, columns[name], numbers)

    return [Table(path, tuple(columns), read_each(path, column), lambda i: f"{numbers[i]}", notes=lambda: tuple(cut))]


def _by_line(path: Path, cut: list[str]) -> tuple[list[Mapping[str, Any]], list[str]]:
    """The objects of all lines, and which line each is; a last line that was not written to its end is left out."""
    records: list[Mapping[str, Any]] = []
    numbers: list[str] = []
    broken: tuple[int, str] | None = None
    with path.open(encoding="utf-8-sig") as file:
        for number, line in enumerate(file, 1):
            if not line.strip():
                continue
            if broken is not None:
                raise _no_json(path, *broken)
            try:
                record = json.loads(line)
            except (ValueError, RecursionError) as error:
                broken = number, str(error)
                continue
            if not isinstance(record, dict):
                raise RecordingError(
                    f"{path}: line {number} holds {_kind(record)}, not an object such as "
                    '{"time_s": 0.0, "torque_nm": 0.1}: write an object a line'
                )
            records.append(record)
            numbers.append(f"line {number}")
            if len(records) > MAX_SAMPLES:
                raise too_long(path, len(records))
    if broken is not None:
        if not records:
            raise _no_json(path, *broken)
        cut.append(f"the last line, {broken[0]}, is cut and is left out")
    if not records:
        raise RecordingError(f"{path}: holds no records: export the recording again")
    return records, numbers


def _whole(path: Path) -> tuple[Sequence[Mapping[str, Any]], list[str]]:
    """The records of a file that is one list of objects, or one object of lists."""
    text = path.read_text(encoding="utf-8-sig")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordingError(
            f"{path}: is not valid JSON ({error}): export it again, or, if it has an object a line, name it .jsonl"
        ) from error
    if isinstance(content, list) and content and all(isinstance(one, dict) for one in content):
        if len(content) > MAX_SAMPLES:
            raise too_long(path, len(content))
        return content, [f"record {i + 1}" for i in range(len(content))]
    lists = dict(_lists(content)) if isinstance(content, dict) else {}
    longest = max((len(values) for values in lists.values()), default=0)
    of_time = {name: values for name, values in lists.items() if len(values) == longest}
    if longest < 2:
        raise RecordingError(
            f'{path}: holds no columns: write a list of objects, [{{"time_s": 0.0, "torque_nm": 0.1}}, ...], or an '
            'object of lists, {"time_s": [...], "torque_nm": [...]}'
        )
    if longest > MAX_SAMPLES:
        raise too_long(path, longest)
    rows = [dict(zip(of_time, row, strict=True)) for row in zip(*of_time.values(), strict=True)]
    return rows, [f"index {i}" for i in range(longest)]


def _lists(content: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, list[Any]]]:
    """Lists in an object and in objects in it, by name."""
    for key, value in content.items():
        if isinstance(value, dict):
            yield from _lists(value, f"{above}{key}.")
        elif isinstance(value, list):
            yield f"{above}{key}", value


def _columns(path: Path, records: Iterable[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Column -> its value in every record, None where a record lacks it."""
    columns: dict[str, list[Any]] = {}
    for count, record in enumerate(records):
        for name, value in _flat(record):
            if name not in columns:
                if len(columns) == MOST_NAMES:
                    raise RecordingError(
                        f"{path}: has more than {MOST_NAMES} names: keep the quantities of the platform"
                    )
                columns[name] = [None] * count
            if len(columns[name]) == count:  # of a name that stands twice in a record, the first
                columns[name].append(value)
        for values in columns.values():
            if len(values) == count:
                values.append(None)
    return columns


def _flat(record: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in record.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        elif isinstance(value, list):
            yield from _flat({str(i): one for i, one in enumerate(value)}, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _numbers(path: Path, name: str, values: Sequence[Any], numbers: Sequence[str]) -> np.ndarray[Any, Any]:
    """A column as numbers; of texts that are times of day, in seconds. Raises RecordingError for other texts."""
    stamps = Stamps()
    out = np.full(len(values), np.nan)
    for i, value in enumerate(values):
        if value is None:
            continue
        try:
            out[i] = stamps.seconds(value) if isinstance(value, str) and is_stamp(value) else float(value)
        except (ValueError, OverflowError):
            shown = value if len(str(value)) < 40 else f"{str(value)[:40]}..."
            raise RecordingError(
                f"{path}: column {name!r} holds the text {shown!r} ({numbers[i]}): write it as a number or leave it out"
            ) from None
    return out


def _no_json(path: Path, number: int, why: str) -> RecordingError:
    return RecordingError(f"{path}: line {number} is not valid JSON ({why}): write one object a line")


def _kind(value: Any) -> str:
    return {list: "a list", str: "a text", int: "a number", float: "a number", bool: "true or false"}.get(
        type(value), "null"
    )
