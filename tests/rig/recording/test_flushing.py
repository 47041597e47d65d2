"""Threads that write and sync beside a loop, and what they bound."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import rig.recording.journal as journal_module
import rig.recording.tail_file as tail_file_module
from rig.excitation import PlannedSet, Sine
from rig.guard import Tick
from rig.interface import GyroSample, TorqueSample
from rig.recording.flushing import Repeating, sync, sync_folder
from rig.recording.journal import Journal
from rig.recording.journal_reader import read_journal
from rig.sequencer.recorder import SetRecorder


def test_work_is_repeated_until_it_is_stopped_and_never_after() -> None:
    times: list[float] = []
    repeating = Repeating("test", lambda: times.append(time.monotonic()), 0.005)
    repeating.start()
    deadline_s = time.monotonic() + 5.0
    while len(times) < 4 and time.monotonic() < deadline_s:
        time.sleep(0.001)
    repeating.stop()
    count = len(times)
    assert count >= 4
    assert np.min(np.diff(times)) > 0.0
    time.sleep(0.02)
    assert len(times) == count


def test_a_slow_sync_does_not_hold_up_what_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entered, release = threading.Event(), threading.Event()

    def slow(descriptor: int) -> None:
        entered.set()
        release.wait(5.0)

    journal = Journal.create(tmp_path / "a.journal", {}, flush_interval_s=0.002)
    journal.begin_run("r", {})
    with monkeypatch.context() as patch:
        patch.setattr(tail_file_module, "sync", slow)
        patch.setattr(journal_module, "SYNC_EVERY_S", 0.002)
        with journal.flushing_in_background():
            journal.append("samples", (0.0, 1.0, 1.0))
            assert entered.wait(5.0)
            journal.append("samples", (0.1, 1.0, 1.0))
            deadline_s = time.monotonic() + 5.0
            while len(read_journal(journal.path).runs[0].tables["samples"]) < 2 and time.monotonic() < deadline_s:
                time.sleep(0.002)
            assert len(read_journal(journal.path).runs[0].tables["samples"]) == 2  # while the sync still hangs
            release.set()
    journal.close()


def test_what_the_disk_refuses_to_sync_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(descriptor: int) -> None:
        raise OSError(5, "Input/output error")

    journal = Journal.create(tmp_path / "a.journal", {})
    journal.begin_run("r", {})
    journal.append("samples", (0.0, 1.0, 1.0))
    journal.flush()
    with monkeypatch.context() as patch:
        patch.setattr(tail_file_module, "sync", broken)
        journal._sync_quietly()
    with pytest.raises(journal_module.JournalError, match="Input/output error"):
        journal.append("samples", (0.1, 1.0, 1.0))
    journal.close()


def test_files_and_folders_are_synced_where_the_system_can(tmp_path: Path) -> None:
    descriptor = os.open(tmp_path / "a", os.O_WRONLY | os.O_CREAT)
    sync(descriptor)
    os.close(descriptor)
    sync_folder(tmp_path)
    sync_folder(tmp_path / "absent")
    assert (tmp_path / "a").exists()


@pytest.mark.parametrize("rate_hz", [10.0, 100.0, 1000.0])
def test_the_recorder_holds_no_more_than_a_few_hundredths_of_a_second(tmp_path: Path, rate_hz: float) -> None:
    planned = PlannedSet("set", Sine(torque_nm=1.0, frequency_hz=1.0, duration_s=3.0))
    with Journal.create(tmp_path / "a.journal", {}) as journal:
        recorder = SetRecorder(planned, 0.0, "zero_order", journal)
        for k in range(1, int(rate_hz / 4) + 20):
            now_s = k / rate_hz
            tick = Tick(now_s, 0.0, 1 / rate_hz, 0.0, (GyroSample(now_s, 0.1, True),), (TorqueSample(now_s, 0.0),), {})
            recorder.take(tick)
            journal.flush()
            run = read_journal(journal.path).runs
            written_s = run[0].column("samples", "time_s")[-1] if run else 0.0
            assert now_s - written_s <= 0.021
