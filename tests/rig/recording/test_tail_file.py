"""A file that takes what comes while it is synced, and what a kill leaves of it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import rig.recording.tail_file as tail_file_module
from commands.campaign.campaign_part import CampaignPart
from drivers.capture.account import summary_of
from drivers.capture.wire_capture import TICK, Capture, read_capture
from rig.recording.journal import Journal
from rig.recording.journal_reader import read_journal
from rig.recording.tail_file import RESERVED_BYTES, TailedFile, missing_of, opened, record, tail_of, whole


class Hanging:
    """A sync that does not come back before it is let go."""

    def __init__(self) -> None:
        self.entered, self.release = threading.Event(), threading.Event()

    def __call__(self, descriptor: int) -> None:
        self.entered.set()
        assert self.release.wait(10.0)


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Hanging:
    sync = Hanging()
    monkeypatch.setattr(tail_file_module, "sync", sync)
    return sync


def _syncing(file: TailedFile, sync: Hanging) -> threading.Thread:
    thread = threading.Thread(target=file.sync)
    thread.start()
    assert sync.entered.wait(5.0)
    return thread


def test_what_comes_during_a_sync_is_readable_at_once_and_in_the_file_itself_afterwards(
    tmp_path: Path, hanging: Hanging
) -> None:
    path = tmp_path / "a"
    file = TailedFile(path)
    file.expect_syncs()
    file.write(b"one ")
    thread = _syncing(file, hanging)
    file.write(b"two ")
    file.write(b"three ")
    assert path.read_bytes() == b"one "
    assert whole(path) == b"one two three "
    hanging.release.set()
    thread.join()
    file.write(b"four")
    assert path.read_bytes() == whole(path) == b"one two three four"
    file.close()
    assert sorted(tmp_path.iterdir()) == [path]


def test_a_sync_includes_what_came_during_the_one_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a"
    synced: list[bytes] = []
    file = TailedFile(path)
    file.expect_syncs()

    def during(descriptor: int) -> None:
        synced.append(path.read_bytes())
        if len(synced) == 1:
            file.write(b"two")

    monkeypatch.setattr(tail_file_module, "sync", during)
    file.write(b"one ")
    file.sync()
    file.sync()
    file.sync()  # nothing new: not a third time
    assert synced == [b"one ", b"one two"]
    file.close()


def test_a_tail_that_is_begun_anew_leaves_nothing_wrong_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(5)
    path = tmp_path / "a"
    expected = bytearray()
    file = TailedFile(path)
    file.expect_syncs()

    def during(descriptor: int) -> None:
        for _ in range(int(random.integers(0, 5))):
            piece = random.bytes(int(random.integers(1, 3000)))
            expected.extend(piece)
            file.write(piece)
            assert whole(path) == expected

    monkeypatch.setattr(tail_file_module, "sync", during)
    for _ in range(60):
        piece = random.bytes(int(random.integers(1, 3000)))
        expected.extend(piece)
        file.write(piece)
        file.sync()
    assert tail_of(path).stat().st_size == RESERVED_BYTES  # it never had to grow
    file.close()
    assert path.read_bytes() == expected


def test_without_a_tail_a_write_goes_to_the_file_itself(tmp_path: Path, hanging: Hanging) -> None:
    path = tmp_path / "a"
    file = TailedFile(path)
    file.write(b"one ")
    thread = _syncing(file, hanging)
    file.write(b"two")
    assert path.read_bytes() == b"one two"
    hanging.release.set()
    thread.join()
    file.close()


def test_where_nothing_more_can_be_written_what_was_taken_stays_in_the_tail(
    tmp_path: Path, hanging: Hanging, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a"
    file = TailedFile(path)
    file.expect_syncs()
    file.write(b"one ")
    thread = _syncing(file, hanging)
    file.write(b"two ")
    hanging.release.set()
    thread.join()

    def full(descriptor: int, data: bytes) -> None:
        os.write(descriptor, data[:3])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(tail_file_module, "_write_all", full)
        with pytest.raises(OSError, match="No space left"):
            file.write(b"three")
        assert path.read_bytes() == b"one "
        assert whole(path) == b"one two "
        with pytest.raises(OSError, match="No space left"):
            file.close()
    assert whole(path) == b"one two "


@pytest.mark.parametrize("cut", [0, 3, 19, 20, 24, 25, 60])
def test_a_tail_that_was_cut_gives_what_is_sound_and_nothing_else(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"0123")
    tail_of(path).write_bytes((record(2, b"2345") + record(6, b"6789") + record(99, b"no"))[:cut])
    assert missing_of(path, 4) == b"456789"[: 0 if cut < 24 else 2 if cut < 48 else 6]


def test_a_tail_from_elsewhere_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"0123")
    lies = b"".join(tail_file_module._HEAD.pack(b"ISPT", 4, 1 << k % 32, 0) for k in range(50_000))
    tail_of(path).write_bytes(lies)
    begun_s = time.process_time()
    assert whole(path) == b"0123"
    assert time.process_time() - begun_s < 2.0
    tail_of(path).unlink()
    (tmp_path / "secret").write_bytes(record(4, b"secret"))
    try:
        tail_of(path).symlink_to(tmp_path / "secret")
    except OSError:
        return  # a system that has no links for everyone
    assert whole(path) == b"0123"


def test_a_file_of_many_gigabytes_is_not_taken_into_memory_for_its_tail(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"0123")
    tail_of(path).write_bytes(record(4, b"45"))
    with opened(path) as file:
        assert file.read() == b"012345"
    monkeypatch.setattr(tail_file_module, "LONGEST_JOINED", 3)
    with opened(path) as file:
        assert file.read() == b"0123"


def test_what_a_journal_and_a_capture_hold_in_their_tails_is_read(tmp_path: Path, hanging: Hanging) -> None:
    hanging.release.set()
    journal = Journal.create(tmp_path / "a.journal", {})
    journal._file.expect_syncs()
    capture = Capture(tmp_path / "raw")
    capture._file.expect_syncs()
    capture.flush()
    hanging.entered.clear()
    hanging.release.clear()
    journal.begin_run("r", {})
    threads = [_syncing(journal._file, hanging)]
    hanging.entered.clear()
    threads.append(_syncing(capture._file, hanging))
    journal.append("samples", (0.5, 1.0, 1.0))
    journal.flush()
    capture.tick(7.0, 1.0)
    capture.flush()
    assert read_journal(journal.path).runs[0].column("samples", "time_s").tolist() == [0.5]
    assert read_journal(journal.path).unread_bytes == 0
    assert [entry.time_s for entry in read_capture(capture.path) if entry.kind == TICK] == [7.0]
    assert summary_of(capture.path).cut_bytes == 0
    hanging.release.set()
    for thread in threads:
        thread.join()
    journal.close()
    capture.close()
    assert not list(tmp_path.rglob("*.tail"))


WRITER = """
import sys, threading, time
from collections import defaultdict
from pathlib import Path
import rig.recording.tail_file as steady
from drivers.capture.wire_capture import Capture
from rig.recording.journal import Journal

held, write = defaultdict(threading.Lock), steady._write_all

def sync(descriptor):  # a disk that is slow, with a file system that holds the file meanwhile
    with held[descriptor]:
        time.sleep(SLOW_S)

def write_all(descriptor, data):
    with held[descriptor]:
        write(descriptor, data)

steady.sync, steady._write_all = sync, write_all
SLOW_S = 0.0
folder = Path(sys.argv[1])
capture = Capture(folder / "raw")
journal = Journal.create(folder / "a.journal", {})
SLOW_S = 0.5
capture.start()
with journal.flushing_in_background():
    journal.begin_run("r", {})
    print("begun", flush=True)
    while True:
        now_s = time.monotonic()
        journal.append("samples", (now_s, 1.0, 1.0))
        capture.tick(now_s, 1.0)
        time.sleep(0.001)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="has no kill -9")
@pytest.mark.parametrize("after_s", [0.15, 0.33, 0.52, 0.71])
def test_a_writer_killed_while_its_disk_syncs_for_half_a_second_has_lost_less_than_a_tenth(
    tmp_path: Path, after_s: float, request: pytest.FixtureRequest
) -> None:
    line = (sys.executable, "-c", WRITER, str(tmp_path))
    process = subprocess.Popen(line, stdout=subprocess.PIPE, cwd=request.config.rootpath)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == b"begun\n"
        time.sleep(after_s)
        at_s = time.monotonic()
        process.send_signal(signal.SIGKILL)
        process.wait()
    finally:
        process.kill()
        process.stdout.close()
    last_s = read_journal(tmp_path / "a.journal").runs[0].column("samples", "time_s")[-1]
    captured_s = [entry.time_s for entry in read_capture(tmp_path / "raw" / "wire.cap") if entry.kind == TICK][-1]
    assert at_s - last_s < 0.1
    assert at_s - captured_s < 0.1


def test_a_tail_goes_with_its_journal_into_the_folder_that_resumes_it(tmp_path: Path) -> None:
    before, after = tmp_path / "before", tmp_path / "after"
    before.mkdir()
    after.mkdir()
    journal = before / "recording.journal"
    journal.write_bytes(b"0123")
    tail_of(journal).write_bytes(record(4, b"45"))
    CampaignPart(copied_journals=((journal, "earlier_1.journal"),)).copy_journals(after)
    assert whole(after / "earlier_1.journal") == b"012345"
