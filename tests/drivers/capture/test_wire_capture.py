"""The raw capture: what crossed the wire, files that were cut, disks that are full."""

import errno

import pytest

from drivers.capture import wire_capture
from drivers.capture.wire_capture import Capture, export, read_capture, unpack_frame
from drivers.codecs.lawicel import CanFrame
from rig.errors import Aborted, DeviceFault, RecordingError
from rig.recording.tail_file import TailedFile
from tests.drivers.wireless import play


def test_capture_holds_what_crossed_the_wire(bench, tmp_path):
    with bench.opened(), bench.armed():
        play(bench, 50)
    entries = list(read_capture(tmp_path / "raw" / "wire.cap"))
    raw = (tmp_path / "raw" / "gyro.bin").read_bytes()
    assert raw == b"".join(e.payload for e in entries if e.kind == wire_capture.GYRO_READ)
    sent = [unpack_frame(e.payload) for e in entries if e.kind == wire_capture.CAN_SENT]
    assert sum(frame.identifier == 0x201 for frame in sent) >= 50
    lines = (tmp_path / "raw" / "can.log").read_text().splitlines()
    assert len(lines) == sum(e.kind in (wire_capture.CAN_READ, wire_capture.CAN_SENT) for e in entries)
    assert lines[0].split()[1:] == ["can0", "000#8001", "T"]


def test_cut_capture_is_read_up_to_the_cut(tmp_path):
    writer = Capture(tmp_path)
    for k in range(10):
        writer.can(float(k), True, CanFrame(k, b"abc"))
    writer.close()
    path = tmp_path / "wire.cap"
    path.write_bytes(path.read_bytes()[:-5])
    assert [unpack_frame(e.payload).identifier for e in read_capture(path)] == list(range(9))
    export(path)
    path.write_bytes(b"something else")
    with pytest.raises(RecordingError, match="not a raw capture"):
        list(read_capture(path))
    with pytest.raises(RecordingError, match="No such file"):
        list(read_capture(tmp_path / "none.cap"))
    with pytest.raises(Aborted, match="File exists"):
        Capture(tmp_path)


def test_frames_of_all_kinds_survive_packing():
    for frame in (
        CanFrame(0x123, b"\x01", False, False, 1),
        CanFrame(0x1ABCDEF0, b"", True, True, 8),
        CanFrame(0x8001, bytes(24), True, False, 24, -1, True),
    ):
        assert unpack_frame(wire_capture.pack_frame(frame)) == frame


def full_disk(monkeypatch):
    def refuse(self, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(TailedFile, "write", refuse)


def test_a_disk_that_is_full_already_is_told_before_the_drive_is_armed(bench, monkeypatch):
    full_disk(monkeypatch)
    monkeypatch.setattr(bench.amplifier, "arm", lambda link: pytest.fail("the drive was enabled"))
    with pytest.raises(Aborted, match="No space left on device"), bench.opened(), bench.armed():
        pytest.fail("it was armed")


def test_a_disk_that_is_full_at_the_end_is_told_as_such(bench, monkeypatch):
    with pytest.raises(Aborted, match="No space left on device"), bench.opened(), bench.armed():
        play(bench, 50)
        full_disk(monkeypatch)


def test_a_capture_that_cannot_be_finished_does_not_hide_what_ended_the_campaign(bench, monkeypatch):
    with pytest.raises(DeviceFault, match="the drive fell silent"), bench.opened(), bench.armed():
        full_disk(monkeypatch)
        raise DeviceFault("the drive fell silent")
