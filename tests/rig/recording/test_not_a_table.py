"""Text that is no table below a header: labels beside the data, one value a row, an arrow behind the time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.recording.readers import read_file
from rig.recording.table import Table
from tests.rig.recording.support import csv_of, motion, read, refusal

M = motion(60)
T, TORQUE, RATE = M["time_s"], M["torque_nm"], M["rate_rad_s"]
LABELS = {"Record Length": "60", "Sample Interval": "1e-3", "Vertical Units": "V", "Horizontal Units": "s"}
SOURCE = {"Source": "CH"}


def beside(labels: dict[str, str], end: str = "") -> str:
    """Two channels side by side, each behind its labels."""
    said = [*labels.items(), *[("", "")] * (len(T) - len(labels))]
    lines = []
    for (label, value), time, *channels in zip(said, T.tolist(), TORQUE.tolist(), RATE.tolist(), strict=True):
        numbered = [f"{value}{i}" if label == "Source" else value for i in (1, 2)]
        blocks = [f"{label},{v},,{time!r},{x!r}" for v, x in zip(numbered, channels, strict=True)]
        lines.append(",,".join(blocks) + end)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("end", ["", ","])
def test_labels_beside_the_data_name_the_channels(end: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(beside(LABELS | SOURCE, end))
    (table,) = read_file(tmp_path / "r.csv")
    assert isinstance(table, Table) and table.names == ("CH1 time", "CH1", "CH2 time", "CH2")
    assert table.units["CH1"] == "V" and table.units["CH2 time"] == "s"
    found = table.read(table.names)
    for name, values in zip(table.names, (T, TORQUE, T, RATE), strict=True):
        np.testing.assert_array_equal(found[name], values)


def test_labels_that_name_no_channel_are_refused_with_the_cure(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(beside(LABELS))
    assert "has its header beside the data: keep the two columns of numbers" in refusal(tmp_path, "r.csv")


@pytest.mark.parametrize("blocks", [False, True])
def test_one_value_a_row_is_refused_with_the_pivot(blocks: bool, tmp_path: Path) -> None:
    """Also where the quantities come in turns of no fixed order."""
    rows = [
        f'"{name}";"2024-05-06 14:03:{time:06.3f}";{value:.6f};1;{45418e6 + time:.4f}'.replace(".", ",")
        for i, (time, *both) in enumerate(zip(T.tolist(), TORQUE.tolist(), RATE.tolist(), strict=True))
        for name, value in sorted(zip(("torque", "rate"), both, strict=True), reverse=bool(blocks and i % 3))
    ]
    (tmp_path / "r.csv").write_text("VarName;TimeString;VarValue;Validity;Time_ms\n" + "\n".join(rows) + "\n")
    said = refusal(tmp_path, "r.csv")
    assert "has one value a row" in said
    assert "pivot_table(index='TimeString', columns='VarName', values='VarValue')" in said


def test_a_word_in_turns_beside_two_quantities_is_a_status(tmp_path: Path) -> None:
    head, *rows = csv_of(M).splitlines()
    words = [f"{row},{'AB'[i % 2]}" for i, row in enumerate(rows)]
    (tmp_path / "r.csv").write_text("\n".join([head + ",state", *words]) + "\n")
    assert len(read(tmp_path, "r.csv").runs[0].time_s) == len(T)


@pytest.mark.parametrize("by", [",", " ", "\t"])
@pytest.mark.parametrize("sent", ["", "23:59:59.969 -> "])
def test_an_arrow_behind_the_time_of_day_parts_the_columns(sent: str, by: str, tmp_path: Path) -> None:
    clock = [f"23:59:59.{970 + i}" if i < 30 else f"00:00:00.{i - 30:03}" for i in range(len(T))]
    pairs = zip(clock, TORQUE.tolist(), RATE.tolist(), strict=True)
    head = by.join((sent + "torque_nm" if sent else f"time_s{by}torque_nm", "rate_rad_s"))
    rows = [f"{at} -> {torque!r}{by}{rate!r}" for at, torque, rate in pairs]
    (tmp_path / "r.csv").write_text("\n".join([head, *rows]) + "\n")
    run = read(tmp_path, "r.csv").runs[0]
    np.testing.assert_allclose(run.time_s - run.time_s[0], T, atol=1e-9)
    assert run.torque_nm is not None
    np.testing.assert_array_equal(run.torque_nm, TORQUE)
