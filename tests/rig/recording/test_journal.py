"""The journal keeps what was written, whatever happens to the writer."""

from __future__ import annotations

import errno
import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rig.errors import RecordingError
from rig.recording import Journal, JournalError, read_journal, recording_from_journal


class Clock:
    """A clock that stands still until told."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def write_two_runs(path: Path) -> None:
    with Journal.create(path, {"axis": "rotary", "noise": 0.01, "config_text": "backend: x"}) as journal:
        for hz in (0.5, 1.0):
            journal.begin_run(f"{hz} Hz", {"frequency_hz": hz, "use": "fit", "torque_hold": "zero_order"})
            for k in range(100):
                journal.append("samples", (k * 1e-3, hz * k, k % 10 != 0))
                journal.append("commands", (k * 1e-3 + 2e-4, 2.0 * k, 2.1 * k))
            journal.event(0.05, "late", {"by_ms": 1.5})
            journal.end_run()


def test_what_was_written_is_read(tmp_path: Path) -> None:
    write_two_runs(tmp_path / "a.journal")
    contents = read_journal(tmp_path / "a.journal")
    assert contents.closed and contents.unread_bytes == 0
    assert [run.name for run in contents.runs] == ["0.5 Hz", "1.0 Hz"]
    assert contents.runs[1].column("samples", "rate_rad_s").tolist() == [float(k) for k in range(100)]
    assert [(e.time_s, e.text, e.values) for e in contents.events] == [(0.05, "late", {"by_ms": 1.5})] * 2


def test_a_recording_comes_of_it(tmp_path: Path) -> None:
    write_two_runs(tmp_path / "a.journal")
    recording = recording_from_journal(read_journal(tmp_path / "a.journal"))
    run = recording.runs[0]
    assert (recording.noise, recording.info["complete"]) == (0.01, True)
    assert (run.frequency_hz, run.use, run.torque_hold) == (0.5, "fit", "zero_order")
    assert run.valid.sum() == 90
    assert run.torque_nm is not None and run.torque_nm[3] == 6.0
    assert run.torque_time_s is not None and run.torque_time_s[0] == 2e-4


def test_further_columns_and_kinds_are_kept(tmp_path: Path) -> None:
    columns = {
        "samples": ("time_s", "rate_rad_s", "angle_rad", "valid", "temperature_c"),
        "clocks": ("host_s", "gyro_s"),
    }
    with Journal.create(tmp_path / "a.journal", {}) as journal:
        journal.begin_run("r", {}, columns)
        journal.append("samples", [(0.0, 1.0, 2.0, 1.0, 30.0), (0.1, 1.5, 2.5, 1.0, 31.0)])
        journal.append("clocks", (5.0, 0.0))
    contents = read_journal(tmp_path / "a.journal")
    run = recording_from_journal(contents).runs[0]
    assert contents.runs[0].tables["clocks"].tolist() == [[5.0, 0.0]]
    assert run.angle_rad is not None and run.angle_rad.tolist() == [2.0, 2.5]
    assert run.channels["temperature_c"].tolist() == [30.0, 31.0]
    assert run.torque_nm is None


def test_rows_reach_the_file_when_the_flush_interval_is_over(tmp_path: Path) -> None:
    clock = Clock()
    journal = Journal.create(tmp_path / "a.journal", {}, flush_interval_s=0.05, clock=clock)
    journal.begin_run("r", {})
    for k in range(100):
        clock.now_s = k * 1e-3
        journal.append("samples", (clock.now_s, 1.0, 1.0))
    contents = read_journal(tmp_path / "a.journal")  # as if the writer had been killed here
    assert 50 <= len(contents.runs[0].tables["samples"]) < 100
    assert not contents.closed and not contents.runs[0].ended
    assert recording_from_journal(contents).info["complete"] is False
    journal.close()


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.integers(0, 12_000), flip=st.integers(0, 12_000))
def test_a_cut_or_damaged_journal_yields_all_before_the_damage(tmp_path: Path, cut: int, flip: int) -> None:
    whole = tmp_path / "whole.journal"
    if not whole.exists():
        write_two_runs(whole)
    data = bytearray(whole.read_bytes()[: max(1, cut)])
    data[flip % len(data)] ^= 0x40
    (tmp_path / "cut.journal").write_bytes(data)
    try:
        contents = read_journal(tmp_path / "cut.journal")
    except RecordingError as error:
        assert "not a journal" in str(error)
        return
    originals = {run.name: run.tables["samples"] for run in read_journal(whole).runs}
    for run in contents.runs:
        rows = run.tables["samples"]
        np.testing.assert_array_equal(rows, originals[run.name][: len(rows)])


def test_damage_in_one_run_costs_its_rest_and_none_of_the_next(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    write_two_runs(path)
    data = bytearray(path.read_bytes())
    at = data.index(b"samples\0") + 200  # within the rows of the first run
    data[at : at + 8] = b"\xff" * 8
    path.write_bytes(data)
    contents = read_journal(path)
    first, second = contents.runs
    assert len(first.tables["samples"]) == 0 and not first.ended
    assert len(second.tables["samples"]) == 100 and second.ended and contents.closed
    assert contents.gaps == 1 and contents.stray_rows == 100  # the commands behind it: whose they are is not known
    assert contents.unread_bytes > 2400


def test_heads_that_lie_do_not_take_for_ever(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    write_two_runs(path)
    lying = struct.pack("<4sB3xII", b"ISPJ", 3, 1_000_000, 0)
    path.write_bytes(path.read_bytes() + lying * 100_000)
    begun_s = time.monotonic()
    contents = read_journal(path)
    assert time.monotonic() - begun_s < 2.0
    assert [run.name for run in contents.runs] == ["0.5 Hz", "1.0 Hz"]


WRITER = """
import sys, time
from rig.recording import Journal
journal = Journal.create(sys.argv[1], {})
journal.begin_run("r", {})
with journal.flushing_in_background():
    print("playing", flush=True)
    while True:
        journal.append("samples", (time.monotonic(), 1.0, 1.0))
        time.sleep(0.001)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs SIGKILL and a common monotonic clock")
def test_a_kill_costs_at_most_100_ms(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    root = Path(__file__).parents[3]
    writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, cwd=root)
    with writer:
        assert writer.stdout is not None and writer.stdout.readline() == b"playing\n"
        time.sleep(0.4)
        killed_at_s = time.monotonic()
        os.kill(writer.pid, signal.SIGKILL)
    times = read_journal(path).runs[0].column("samples", "time_s")
    assert killed_at_s - times[-1] < 0.1
    assert times[-1] - times[0] > 0.2


def test_a_full_disk_is_said_and_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    room = [200]

    def write_until_full(descriptor: int, data: bytes) -> int:
        if room[0] <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = write(descriptor, bytes(data)[: room[0]])
        room[0] -= count
        return count

    journal = Journal.create(tmp_path / "a.journal", {})
    journal.begin_run("r", {})
    journal.append("samples", (0.0, 1.0, 1.0))
    journal.flush()
    monkeypatch.setattr(os, "write", write_until_full)
    journal.append("samples", [(0.1 * k, 1.0, 1.0) for k in range(1, 100)])
    with pytest.raises(JournalError, match=r"a\.journal: No space left on device.*is kept there; free space"):
        journal.flush()
    assert len(read_journal(tmp_path / "a.journal").runs[0].tables["samples"]) == 1
    with pytest.raises(JournalError):
        journal.append("samples", (99.0, 1.0, 1.0))
    room[0] = 10**6  # someone made room: the rest follows, without a damaged frame in between
    journal.close()
    contents = read_journal(tmp_path / "a.journal")
    assert len(contents.runs[0].tables["samples"]) == 100
    assert contents.closed


def test_a_failure_in_the_background_meets_the_next_append(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    journal = Journal.create(tmp_path / "a.journal", {}, flush_interval_s=0.002)
    journal.begin_run("r", {})

    def full(descriptor: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch, journal.flushing_in_background():
        patch.setattr(os, "write", full)
        with pytest.raises(JournalError, match="No space left"):
            for k in range(1000):
                journal.append("samples", (k * 1e-3, 1.0, 1.0))
                time.sleep(0.001)
    journal.close()
    assert len(read_journal(tmp_path / "a.journal").runs[0].tables["samples"]) >= 1


def test_an_existing_journal_is_never_overwritten(tmp_path: Path) -> None:
    (tmp_path / "a.journal").write_text("precious")
    with pytest.raises(JournalError, match="choose another --out"):
        Journal.create(tmp_path / "a.journal", {})
    assert (tmp_path / "a.journal").read_text() == "precious"


def test_a_full_disk_ends_a_campaign_as_ctrl_c_does() -> None:
    assert JournalError.exit_code == 130


@pytest.mark.parametrize("rows", [(1.0, 2.0), [[1.0, 2.0, 3.0, 4.0]]])
def test_rows_that_do_not_fit_their_columns_are_a_programming_error(tmp_path: Path, rows: object) -> None:
    with Journal.create(tmp_path / "a.journal", {}) as journal:
        journal.begin_run("r", {})
        with pytest.raises(ValueError, match="do not fit columns"):
            journal.append("samples", rows)  # type: ignore[arg-type]


def test_an_aborted_run_is_kept_without_its_end(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), Journal.create(tmp_path / "a.journal", {}) as journal:
        journal.begin_run("r", {})
        journal.append("samples", (0.0, 1.0, 1.0))
        raise KeyboardInterrupt
    contents = read_journal(tmp_path / "a.journal")
    assert contents.closed
    assert len(recording_from_journal(contents).runs[0].time_s) == 1
