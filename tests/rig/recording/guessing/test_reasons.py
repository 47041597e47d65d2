"""Why a file cannot be used is said once, whatever the number of its columns, with the cure that fits."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.errors import RecordingError
from rig.recording.guessing.columns import columns_of
from rig.recording.readers import read_file
from rig.recording.table import Table

ROWS = [f"{i / 1000!r},{i % 7},{i % 5}" for i in range(40)]


def why(folder: Path, text: str) -> str:
    (folder / "r.csv").write_text(text)
    (table,) = read_file(folder / "r.csv")
    assert isinstance(table, Table)
    with pytest.raises(RecordingError) as error:
        columns_of(table)
    return str(error.value)


def test_a_fault_of_every_column_is_said_once_with_their_names(tmp_path: Path) -> None:
    said = why(tmp_path, "time_s,torque_nm,rate_rad_s\n")
    assert said.endswith(
        "are needed: 'time_s', 'torque_nm', 'rate_rad_s': only a header, no data: export the recording again"
    )


def test_what_stands_in_the_fields_makes_no_other_fault(tmp_path: Path) -> None:
    said = why(tmp_path, "time_s,torque_nm,rate_rad_s\n(z),(furlong),(ell)\n" + "\n".join(ROWS) + "\n")
    assert said.count("a row of units that are not known?") == 1
    assert "'time_s', 'torque_nm', 'rate_rad_s': line 2: '(z)' is not a number" in said


def test_different_faults_are_said_with_the_column_of_each(tmp_path: Path) -> None:
    said = why(tmp_path, "time_s,day,torque,rate\n" + "".join(f"{i},2024-05-06,1 Nm,2 rad/s\n" for i in range(40)))
    assert "'day': line 2: '2024-05-06' is a date without a time of day" in said
    assert "'torque', 'rate': line 2: '1 Nm' is a number with a unit" in said
    assert "export them as columns" not in said


def test_a_header_of_another_width_than_all_rows_is_to_be_corrected_and_not_the_row(tmp_path: Path) -> None:
    said = why(tmp_path, "time,torque,rate\n" + "".join(f"2024-05-06 14:03:07,{i:03},{i % 7},2\n" for i in range(40)))
    assert said.count("line 2 has 4 fields where the header names 3, and so have the others: name every column") == 1
    assert "separate the columns by semicolons" in said and "complete or delete" not in said
    said = why(tmp_path, "time,torque,rate\n0,1,2,3\n" + "\n".join(ROWS) + "\n")
    assert "line 2 has 4 fields where the header names 3: complete or delete the line" in said
