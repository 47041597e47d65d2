"""The CAN log in the formats of the trade holds the frames that crossed the bus."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import can
import pytest

from drivers.capture.account import export_if_missing, summary_of
from drivers.capture.can_export import messages_of, write_can_log
from drivers.capture.wire_capture import Capture
from drivers.codecs.lawicel import CanFrame
from rig.errors import RecordingError, UsageError

FRAMES = (
    CanFrame(0x181, bytes(range(8))),
    CanFrame(0x80, b""),
    CanFrame(0x1FFFFFFF, b"\xff", extended=True),
    CanFrame(0x2, b"", remote=True, length=4),
    CanFrame(0x8001, bytes(range(48)), extended=True, fd=True),
)


def capture(folder: Path) -> Path:
    written = Capture(folder / "raw")
    for k, frame in enumerate(FRAMES * 3):
        written.gyro_read(23602.1 + k * 1e-3, b"gyro")
        written.can(23602.123456789 + k * 0.00051, bool(k % 2), frame)
    written.close()
    return folder / "raw" / "wire.cap"


# asammdf and python-can's reader of MF4 leave temporary files to the collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("suffix", ["blf", "asc", "mf4"])
def test_frames_survive(tmp_path: Path, suffix: str) -> None:
    if suffix == "mf4" and find_spec("asammdf") is None:
        pytest.skip("asammdf is not installed: pip install isp-rig[mf4]")
    path = capture(tmp_path)
    wanted = list(messages_of(path))
    assert write_can_log(path, tmp_path / f"can.{suffix}") == len(wanted) == 15
    found = list(can.LogReader(tmp_path / f"can.{suffix}"))
    zero_s = found[0].timestamp
    for one, other in zip(found, wanted, strict=True):
        assert one.timestamp - zero_s == pytest.approx(other.timestamp, abs=1.1e-6)
        for field in ("arbitration_id", "is_extended_id", "is_remote_frame", "is_rx", "is_fd", "dlc"):
            assert getattr(one, field) == getattr(other, field), field
        assert bytes(one.data) == bytes(other.data)


def test_nothing_is_overwritten_and_a_capture_without_frames_is_said(tmp_path: Path) -> None:
    path = capture(tmp_path)
    (tmp_path / "can.blf").write_text("precious")
    with pytest.raises(UsageError, match="never overwritten"):
        write_can_log(path, tmp_path / "can.blf")
    assert (tmp_path / "can.blf").read_text() == "precious"
    path.write_bytes(b"ISPRAW1\n")
    with pytest.raises(RecordingError, match="holds no CAN frame"):
        write_can_log(path, tmp_path / "other.blf")


def test_a_capture_cut_anywhere_is_read_to_its_last_whole_record(tmp_path: Path) -> None:
    path = capture(tmp_path)
    whole = path.read_bytes()
    for cut in range(8, len(whole), 7):
        path.write_bytes(whole[:cut])
        account = summary_of(path)
        assert 0 <= account.cut_bytes < 80
        assert account.frames <= 15 and account.gyro_bytes % 4 == 0
    path.write_bytes(whole[:-30] + bytes(200))  # a hole of zeros, as a power cut leaves it
    assert summary_of(path).cut_bytes >= 170


def test_what_a_kill_left_unexported_is_exported_once(tmp_path: Path) -> None:
    path = capture(tmp_path)
    account = summary_of(path)
    names = [file.name for file in export_if_missing(path, account)]
    assert names == ["gyro.bin", "can.log"]
    assert export_if_missing(path, account) == []
    (path.with_name("gyro.bin")).write_bytes(b"cut")
    assert [file.name for file in export_if_missing(path, account)] == ["recovered_gyro.bin", "recovered_can.log"]
    assert (path.with_name("gyro.bin")).read_bytes() == b"cut"


def test_no_command_waits_for_the_package_of_mf4_logs() -> None:
    program = "import drivers.transport.can_link, sys; print([m for m in ('asammdf', 'pandas') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
