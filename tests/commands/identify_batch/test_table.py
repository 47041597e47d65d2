"""The table: its order, its types, and that the same rows give the same file."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from commands.identify_batch.row import COLUMNS, Row
from commands.identify_batch.table import write_table

ROWS: list[Row] = [
    dict.fromkeys(COLUMNS)
    | {"path": path, "effects": ["creep"], "accepted": True, "recorded_utc": "2025-03-01T12:00:00+00:00", "seconds": 2}
    for path in ("b", "a", "c")
]


def test_rows_stand_by_path_with_one_type_a_column(tmp_path: Path) -> None:
    write_table(tmp_path / "t.parquet", ROWS)
    table = pq.read_table(tmp_path / "t.parquet")
    assert table.column_names == list(COLUMNS)
    assert table["path"].to_pylist() == ["a", "b", "c"]
    first = table.to_pylist()[0]
    assert first["recorded_utc"] == datetime(2025, 3, 1, 12, tzinfo=UTC)
    assert (first["effects"], first["accepted"], first["seconds"], first["inertia_value"]) == (
        ["creep"],
        True,
        2.0,
        None,
    )


def test_the_same_rows_give_the_same_bytes_in_whatever_order_they_came(tmp_path: Path) -> None:
    write_table(tmp_path / "one.parquet", ROWS)
    write_table(tmp_path / "other.parquet", ROWS[::-1])
    assert (tmp_path / "one.parquet").read_bytes() == (tmp_path / "other.parquet").read_bytes()


def test_a_table_that_cannot_be_written_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_table(tmp_path / "t.parquet", ROWS)
    before = (tmp_path / "t.parquet").read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(OSError, match="No space"):
        write_table(tmp_path / "t.parquet", ROWS[:1])
    assert [p.name for p in tmp_path.iterdir()] == ["t.parquet"]
    assert (tmp_path / "t.parquet").read_bytes() == before


def test_a_name_of_a_file_that_is_no_text_is_shown_by_its_bytes(tmp_path: Path) -> None:
    write_table(tmp_path / "t.parquet", [ROWS[0] | {"path": "a\udcff", "effects": ["b\udcfe"]}])
    (row,) = pq.read_table(tmp_path / "t.parquet").to_pylist()
    assert (row["path"], row["effects"]) == (r"a\udcff", [r"b\udcfe"])
