"""The rows as a Parquet file, sorted by path."""

from __future__ import annotations

import os
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from commands.identify_batch.row import COLUMNS, FLAG, NUMBER, TEXT, TEXTS, TIME, Row


def write_table(path: Path, rows: Iterable[Row]) -> None:
    """Write the table in one piece: until the new one is whole, the old one stands.

    The same rows give the same bytes (with the same pyarrow). Raises OSError where it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {
        TEXT: pa.string(), TEXTS: pa.list_(pa.string()), NUMBER: pa.float64(), FLAG: pa.bool_(),
        TIME: pa.timestamp("us", tz="UTC"),
    }  # fmt: skip
    schema = pa.schema([pa.field(name, types[kind]) for name, kind in COLUMNS.items()])
    ordered = sorted(rows, key=lambda row: str(row["path"]))
    columns = {name: [_value(row.get(name), kind) for row in ordered] for name, kind in COLUMNS.items()}
    partial = path.with_name(f".{path.name}.part")
    try:
        with partial.open("wb") as file:
            pq.write_table(pa.table(columns, schema), file, compression="zstd")
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _value(value: Any, kind: str) -> Any:
    if value is None:
        return None
    if kind == TIME:
        return moment(value)
    if kind == TEXT:
        return _as_utf8(value)
    if kind == TEXTS:
        return [_as_utf8(one) for one in value]
    return float(value) if kind == NUMBER else value


def _as_utf8(text: str) -> str:
    """Bytes of a file's name that are no UTF-8 as ``\\udcff``: Parquet takes no others."""
    return text.encode("utf-8", "backslashreplace").decode()


def moment(text: str) -> datetime | None:
    """A date as recordings write it; None where it is none."""
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        return None
    return found if found.tzinfo else found.replace(tzinfo=UTC)
