"""A spreadsheet's moment exactly at midnight, which its reader gives as a date without a time."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from rig.recording.readers import read_file

openpyxl = pytest.importorskip("openpyxl")
pytest.importorskip("python_calamine")


@pytest.mark.parametrize("begin", [datetime(2024, 5, 6, 23, 59, 59), datetime(2024, 5, 7)])
def test_a_recording_over_midnight_and_one_that_begins_there_keep_their_time(begin: datetime, tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["moment", "torque (N m)", "rate (rad/s)"])
    for k in range(200):
        sheet.append([begin + timedelta(milliseconds=10 * k), 1.0 + k, 0.1 * k])
    book.save(tmp_path / "run.xlsx")
    (table,) = read_file(tmp_path / "run.xlsx")
    moment_s = table.read(["moment"])["moment"]
    np.testing.assert_allclose(np.diff(moment_s), 0.01, atol=2e-3)
    assert len(moment_s) == 200
