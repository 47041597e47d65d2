"""Numbers that stand for no reading are lost rows and told; large readings stay what they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commands.rig.app import app
from identify.runs.reading import describe_missing
from rig.recording.sentinels import sentinels
from tests.commands.support import command
from tests.rig.recording.support import csv_of, motion, read, refusal


def with_number(name: str, number: float, *rows: int) -> dict[str, np.ndarray]:
    columns = motion(500)
    columns[name] = columns[name].copy()
    columns[name][list(rows)] = number
    return columns


@pytest.mark.parametrize("number", [-9999.0, 9999.99, 9.9e37, 1e300, 32767.0, -32768.0, 3.4028234663852886e38])
@pytest.mark.parametrize("name", ["torque_nm", "rate_rad_s", "angle_rad"])
def test_a_number_for_no_reading_is_a_lost_row_and_told(number: float, name: str, tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(csv_of(with_number(name, number, 100, 101, 300)))
    (run,) = read(tmp_path, "run.csv").runs
    assert np.flatnonzero(~run.valid).tolist() == [100, 101, 300]
    assert run.torque_nm is not None and np.max(np.abs(run.torque_nm)) <= 3.0
    (said,) = describe_missing([run], lambda _: None)
    quantity = name.partition("_")[0]
    assert f"run.csv (3 within, no {quantity}; the file has {number:.6g} as {quantity})" in said


def test_rig_init_and_rig_check_say_it_and_guess_without_it(tmp_path: Path) -> None:
    columns = with_number("rate_rad_s", -9999.0, 100)
    text = csv_of(columns).replace("rate_rad_s", "rate").replace("torque_nm", "torque").replace("time_s", "t")
    (tmp_path / "run.csv").write_text(text)
    done = command(app, "init", tmp_path / "run.csv", "--out", tmp_path / "rig.yaml", "--yes")
    assert done.exit_code == 0, done.output
    assert "2, and -9999 for no reading" in done.stdout and "deg/s" not in done.stdout
    said = "Rows in which a column has no value are left out: run.csv (1 within, no rate; the file has -9999 as rate)"
    assert said in done.stdout
    assert f"reading {said}" in command(app, "check", tmp_path / "rig.yaml").stdout


def test_where_a_column_valid_says_that_it_counts_it_is_refused(tmp_path: Path) -> None:
    columns = with_number("torque_nm", -9999.0, 7) | {"valid": np.ones(500)}
    (tmp_path / "run.csv").write_text(csv_of(columns))
    message = refusal(tmp_path, "run.csv")
    assert (
        "line 9: torque is -9999 (1 such samples), which stands for no reading beside values of up to 2.99995"
        in message
    )
    assert "mark the row valid = 0" in message
    columns["valid"][7] = 0.0
    (tmp_path / "run.csv").write_text(csv_of(columns))
    (run,) = read(tmp_path, "run.csv").runs
    assert np.flatnonzero(~run.valid).tolist() == [7]


def test_readings_that_are_large_themselves_stand_for_nothing_else() -> None:
    counts = 30_000.0 * np.sin(np.arange(500.0) / 20.0)
    counts[70:80] = 32767.0  # a converter at its end
    assert sentinels(counts) == {}
    assert sentinels(np.full(500, 9999.0)) == {}
    pulse = np.zeros(500)
    pulse[250] = 1234.5
    assert sentinels(pulse) == {}
    assert sentinels(np.where(np.arange(500) % 3, 0.1 * np.arange(500), -9999.0)) == {-9999.0: 167}
    assert sentinels(np.where(np.arange(500) % 3, -9999.0, 0.1 * np.arange(500))) == {-9999.0: 333}
    switched = np.where(np.arange(500) // 50 % 2, -9999.0, 9999.0)
    switched[::20] = 0.0
    assert sentinels(switched) == {}
    assert sentinels(np.where(np.arange(500) % 2, -9999.0, 0.1 * np.arange(500))) == {-9999.0: 250}
