"""JSON recordings: an object a line, a list of objects, an object of lists; a refusal says where and what to do."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording.readers import read_file
from rig.recording.table import Table

ROWS: list[Mapping[str, Any]] = [
    {"time_s": 0.001 * i, "drive": {"torque_nm": 0.1 * i}, "gyro": [0.5 * i, 0.0]} for i in range(5)
]


def table(path: Path, text: str) -> Table:
    path.write_text(text, encoding="utf-8")
    found = read_file(path)[0]
    assert isinstance(found, Table)
    return found


def lines(rows: list[Mapping[str, Any]]) -> str:
    return "".join(json.dumps(row) + "\n" for row in rows)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("run.jsonl", lines(ROWS)), ("run.ndjson", "\ufeff\n" + lines(ROWS)), ("run.json", json.dumps(ROWS)),
        (
            "lists.json",
            json.dumps(
                {
                    "time_s": [r["time_s"] for r in ROWS], "drive": {"torque_nm": [0.1 * i for i in range(5)]},
                    "gyro": {"0": [0.5 * i for i in range(5)], "1": [0.0] * 5}, "rig": "bench 3", "version": [1],
                }
            ),
        ),
    ],
)  # fmt: skip
def test_the_same_columns_come_of_every_way_to_write_them(tmp_path: Path, name: str, text: str) -> None:
    found = table(tmp_path / name, text)
    assert found.names == ("time_s", "drive.torque_nm", "gyro.0", "gyro.1")
    read = found.read(["time_s", "drive.torque_nm", "gyro.0"])
    assert np.allclose(read["time_s"], 0.001 * np.arange(5))
    assert np.allclose(read["drive.torque_nm"], 0.1 * np.arange(5))
    assert np.allclose(read["gyro.0"], 0.5 * np.arange(5))
    assert found.notes() == ()


def test_what_a_record_lacks_is_no_reading_also_of_a_name_that_begins_later(tmp_path: Path) -> None:
    rows = [{"t": 0.0, "rate": 1.0}, {"t": 1.0}, {"t": 2.0, "rate": None, "torque": 3.0}]
    read = table(tmp_path / "r.jsonl", lines([*rows])).read(["rate", "torque"])  # type: ignore[list-item]
    assert np.array_equal(read["rate"], [1.0, np.nan, np.nan], equal_nan=True)
    assert np.array_equal(read["torque"], [np.nan, np.nan, 3.0], equal_nan=True)


def test_time_stamps_become_seconds(tmp_path: Path) -> None:
    rows = [{"time": f"2026-03-01T23:59:59.{k}+01:00", "rate": 1.0} for k in ("998", "999")]
    read = table(tmp_path / "r.jsonl", lines([*rows, {"time": "2026-03-02T00:00:00+01:00"}])).read(["time"])
    assert np.allclose(np.diff(read["time"]), 1e-3)


def test_a_last_line_that_was_cut_is_left_out_and_told(tmp_path: Path) -> None:
    found = table(tmp_path / "r.jsonl", lines(ROWS) + '{"time_s": 0.00')
    assert len(found.read(["time_s"])["time_s"]) == 5
    assert found.notes() == ("the last line, 6, is cut and is left out",)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.jsonl", '{"t": 0}\n{"t": \n{"t": 1}\n', "line 2 is not valid JSON"),
        ("b.jsonl", "[0.0, 1.0]\n", "line 1 holds a list, not an object such as"),
        ("c.jsonl", '{"t"', "line 1 is not valid JSON"),
        ("d.jsonl", "\n\n", "holds no records"),
        ("e.json", '{"t": 0}\n{"t": 1}\n', "name it .jsonl"),
        ("f.json", '{"accepted": true}', "holds no columns: write a list of objects"),
        ("g.json", "[1, 2, 3]", "holds no columns"),
        ("h.json", "[" * 100_000, "is not valid JSON"),
    ],
)
def test_what_is_no_recording_is_refused_with_what_to_do(tmp_path: Path, name: str, text: str, said: str) -> None:
    with pytest.raises(RecordingError) as refused:
        table(tmp_path / name, text)
    assert said in str(refused.value)


def test_a_column_of_words_is_refused_with_the_line_where_it_begins(tmp_path: Path) -> None:
    found = table(tmp_path / "r.jsonl", lines([{"t": 0.0, "state": None}, {"t": 1.0, "state": "enabled"}]))
    assert np.allclose(found.read(["t"])["t"], [0.0, 1.0])
    with pytest.raises(RecordingError, match=r"column 'state' holds the text 'enabled' \(line 2\)"):
        found.read(["state"])


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / "r.json").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(RecordingError, match="cannot be read as text"):
        read_file(tmp_path / "r.json")
