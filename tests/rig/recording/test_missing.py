"""Rows without a value at the ends of a run are left out, those within are lost, and from_s counts before any check."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from asammdf import MDF, Signal
from nptdms import ChannelObject, TdmsWriter

from identify.runs.reading import describe_missing
from rig.recording.run import Run
from tests.rig.recording.support import csv_of, motion, read, refusal


def written(folder: Path, **changed: object) -> str:
    columns = motion(2000) | changed
    (folder / "run.csv").write_text(csv_of(columns).replace("nan", ""))
    return "run.csv"


def lacking(name: str, *rows: int | slice) -> dict[str, object]:
    values = motion(2000)[name].copy()
    for at in rows:
        values[at] = np.nan
    return {name: values}


def only(folder: Path, file: str, options: str = "", entry: str = "") -> Run:
    (run,) = read(folder, file, options, entry).runs
    return run


def test_rows_at_the_ends_without_a_value_are_left_out_and_told(tmp_path: Path) -> None:
    file = written(tmp_path, **lacking("rate_rad_s", slice(0, 250)), **lacking("torque_nm", slice(1900, None)))
    run = only(tmp_path, file)
    assert (run.time_s[0], run.time_s[-1]) == (0.25, pytest.approx(1.899)) and run.valid.all()
    (said,) = describe_missing([run], lambda _: None)
    assert "run.csv (250 at the beginning and 100 at the end, no torque or rate)" in said


def test_rows_within_without_a_value_are_lost(tmp_path: Path) -> None:
    run = only(tmp_path, written(tmp_path, **lacking("angle_rad", 700), **lacking("torque_nm", slice(900, 906))))
    assert np.flatnonzero(~run.valid).tolist() == [700, *range(900, 906)]
    assert run.torque_nm is not None and len(run.torque_nm) == 1994
    (said,) = describe_missing([run], lambda _: None)
    assert "7 within, no torque or angle" in said


def test_from_s_and_to_s_count_before_the_numbers_are_checked(tmp_path: Path) -> None:
    bad = motion(2000)["rate_rad_s"].copy()
    bad[:300], bad[1700:] = np.inf, 3e200
    run = only(tmp_path, written(tmp_path, rate_rad_s=bad), entry="      from_s: 0.5\n      to_s: 1.5\n")
    assert len(run.time_s) == 1001 and run.missing is None
    message = refusal(tmp_path, written(tmp_path, rate_rad_s=bad), entry="      from_s: 0.5\n")
    assert "line 1702: rate is 3e+200" in message


def test_columns_that_stand_in_rows_of_their_own_are_read_at_the_slowest(tmp_path: Path) -> None:
    m = motion(4000)
    even = np.arange(4000) % 2 == 0
    rate, torque = np.where(even, m["rate_rad_s"], np.nan), np.where(even, np.nan, m["torque_nm"])
    rate[1000:1500] = np.nan  # a hole is not filled up
    columns = {"time_s": m["time_s"], "torque_nm": torque, "rate_rad_s": rate}
    (tmp_path / "run.csv").write_text(csv_of(columns).replace("nan", ""))
    run = only(tmp_path, "run.csv")
    assert run.rate_rad_s is not None and run.torque_nm is not None and run.torque_time_s is not None
    np.testing.assert_allclose(run.torque_nm, 3 * np.sin(20 * run.torque_time_s), atol=1e-3)
    np.testing.assert_allclose(run.rate_rad_s[run.valid], 2 * np.cos(40 * run.time_s[run.valid]), atol=2e-3)
    assert not np.any(run.valid & (run.time_s > 1.001) & (run.time_s < 1.499))
    assert any("interpolated linearly: run.csv (torque)" in s for s in describe_missing([run], lambda _: None))


def test_columns_that_never_have_a_value_together_are_refused(tmp_path: Path) -> None:
    file = written(tmp_path, **lacking("rate_rad_s", slice(0, 1200)), **lacking("torque_nm", slice(800, None)))
    assert "has no value in any of" in refusal(tmp_path, file)


def test_invalidation_bits_of_an_mdf_file_are_lost_rows(tmp_path: Path) -> None:
    m = motion(2000)
    bits = np.zeros(2000, dtype=bool)
    bits[500:520] = True
    with MDF() as file:
        file.append([
            Signal(m["torque_nm"], m["time_s"], unit="Nm", name="torque_nm"),
            Signal(m["rate_rad_s"], m["time_s"], unit="rad/s", name="rate_rad_s", invalidation_bits=bits),
        ])  # fmt: skip
        file.save(tmp_path / "run.mf4")
    run = only(tmp_path, "run.mf4")
    assert len(run.time_s) == 2000 and np.flatnonzero(~run.valid).tolist() == list(range(500, 520))


@pytest.mark.parametrize("by", ["wf_start_offset", "wf_start_time"])
def test_groups_that_begin_at_different_times_share_what_both_have(tmp_path: Path, by: str) -> None:
    m = motion(2000)
    with TdmsWriter(tmp_path / "run.tdms") as file:
        for group, name, unit, start in (("a", "torque_nm", "Nm", 0.0), ("b", "rate_rad_s", "rad/s", 0.25)):
            begin = np.datetime64("2026-05-01T12:00:00") + np.timedelta64(round(1000 * start), "ms")
            properties = {"wf_increment": 1e-3, by: begin if by == "wf_start_time" else start, "unit_string": unit}
            values = m[name][round(start / 1e-3) :]
            file.write_segment([ChannelObject(group, name, values, properties)])
    run = only(tmp_path, "run.tdms")
    assert run.rate_rad_s is not None and run.torque_nm is not None and run.valid.all()
    assert len(run.time_s) == 1750
    np.testing.assert_allclose(run.torque_nm, m["torque_nm"][250:], atol=1e-9)
    np.testing.assert_allclose(run.rate_rad_s, m["rate_rad_s"][250:], atol=1e-9)
