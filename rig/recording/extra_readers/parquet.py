"""Apache Parquet, by pyarrow: one column a quantity, with a unit in the field's metadata where one is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rig.arrays import Array
from rig.errors import RecordingError
from rig.recording.extra_readers.packages import require
from rig.recording.readers.status import MOST_WORDS, Status
from rig.recording.table import MAX_SAMPLES, Table, read_each, too_long
from rig.units import NS

UNIT_KEYS = (b"unit", b"units", b"Unit")


def read(path: Path) -> Sequence[Table]:
    """One table. Raises RecordingError where pyarrow is missing or the file is damaged."""
    require("pyarrow", path, "parquet")
    import pyarrow as pa  # noqa: PLC0415  an extra, and slow to import
    import pyarrow.parquet as pq  # noqa: PLC0415

    try:
        file = pq.ParquetFile(path)
        if file.metadata.num_rows > MAX_SAMPLES:
            raise too_long(path, file.metadata.num_rows)
        table = file.read().flatten()
    except (pa.ArrowException, OSError, ValueError) as error:
        raise RecordingError(f"{path}: is not a valid Parquet file ({error}): export the recording again") from error

    def column(name: str) -> Any:
        return _values(path, name, table.column(name).combine_chunks())

    names = [name for name in table.column_names if name]
    return [
        Table(
            path,
            tuple(names),
            read_each(path, column),
            lambda index: f"row {index + 1}",
            units_of(table.schema),
            notes=lambda: _told(table),
        )
    ]


def _told(table: Any) -> list[str]:
    """What columns of words say of the rows."""
    import pyarrow as pa  # noqa: PLC0415  an extra, and slow to import
    import pyarrow.compute as pc  # noqa: PLC0415

    found = []
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
        if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
            continue
        words = column.cast(pa.large_string()).fill_null("")
        counts = {str(one["values"]): int(one["counts"]) for one in words.value_counts().to_pylist()[: MOST_WORDS + 1]}
        first = {word: f"row {pc.index(words, word).as_py() + 1}" for word in counts}
        found.append(Status(name, Counter(counts), first).told())
    return [text for text in found if text]


def opened(path: Path) -> Any:
    """The file as pyarrow has it, nothing of it read."""
    import pyarrow.parquet as pq  # noqa: PLC0415  an extra, and slow to import

    return pq.ParquetFile(path)


def units_of(schema: Any) -> Mapping[str, str]:
    """Column -> unit, where its metadata states one."""
    return {f.name: unit for f in schema if (unit := _unit(f.metadata or {}))}


def columns_of(path: Path, table: Any, names: Sequence[str]) -> Mapping[str, Array]:
    """Columns of a table of pyarrow as float64."""
    return read_each(path, lambda name: _values(path, name, table.column(name).combine_chunks()))(names)


def _unit(metadata: Any) -> str:
    return next((metadata[key].decode("utf-8", "replace") for key in UNIT_KEYS if key in metadata), "")


def _values(path: Path, name: str, column: Any) -> Any:
    """Values as NumPy has them: times of day as seconds since the first, what is missing as NaN."""
    import pyarrow as pa  # noqa: PLC0415

    if pa.types.is_timestamp(column.type) or pa.types.is_duration(column.type):
        whole = column.cast(pa.duration("ns") if pa.types.is_duration(column.type) else pa.timestamp("ns"))
        ns = whole.cast(pa.int64())
        if ns.null_count:
            raise RecordingError(f"{path}: column {name!r} has rows without a time: leave them out")
        counts = ns.to_numpy(zero_copy_only=False)
        return NS * (counts - counts[0])
    if pa.types.is_decimal(column.type):
        column = column.cast(pa.float64())
    if column.null_count and (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        column = column.cast(pa.float64())
    return np.asarray(column.to_numpy(zero_copy_only=False))
