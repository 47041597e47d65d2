"""A bench without wires: an emulated gyro's bytes and an emulated drive, captured, then replayed."""

import errno
import math

import numpy as np
import pytest

import drivers.bench.devices
import drivers.transport.can_link
from drivers.bench import BenchRig
from drivers.bench.retiming import BenchRetiming
from drivers.capture import wire_capture
from drivers.capture.wire_capture import Capture, export, read_capture, unpack_frame
from drivers.codecs import stim300
from drivers.codecs.lawicel import CanFrame
from drivers.replay import ReplayRig
from drivers.replay.recording import recording_from_capture
from rig.config.bench import AmplifierConfig, BenchConfig, CanConfig, GyroscopeConfig, RealTimeConfig
from rig.errors import Aborted, DeviceFault, RecordingError
from rig.interface import Torque
from rig.recording.steady import SteadyFile
from sim_backend.emulators.drive import Cia402Drive
from tests.drivers.emulated_bus import EmulatedBus, FakeTime

CONFIG = BenchConfig(
    gyroscope=GyroscopeConfig(port="wire", settings={"datagram": 0x90}),
    amplifier=AmplifierConfig(can=CanConfig(channel="bus")),
    real_time=RealTimeConfig(priority=0, lock_memory=False),
    settle_s=1.0,
)


class GyroPort:
    """A STIM300 whose datagrams appear as time passes; every tenth read is cut in the middle."""

    name = "wire"

    def __init__(self, time):
        self.time, self.sent, self.begin_s, self.rest = time, 0, time.now_s, b""
        self.vanished = False

    def fileno(self):
        return None

    def read(self):
        if self.vanished:
            raise DeviceFault("wire has vanished (test)")
        due = int((self.time.now_s - self.begin_s) * 2000)
        data = self.rest
        for k in range(self.sent, due):
            word = round(100 * math.sin(k / 100) / stim300.RATE_LSB_DEG_S)
            data += stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, word), 0, k & 255, 506))
        self.sent = due
        keep = 7 if due % 10 == 0 and len(data) > 7 else 0
        data, self.rest = data[: len(data) - keep], data[len(data) - keep :]
        return data

    def write(self, data, timeout_s=0.1):
        pass

    def wait_readable(self, timeout_s):
        self.time.now_s += timeout_s
        return True

    def close(self):
        pass


@pytest.fixture
def bench(monkeypatch, tmp_path):
    time = FakeTime()
    drive = Cia402Drive(1, 100.0, 150.0)
    monkeypatch.setattr(drivers.transport.can_link.time, "sleep", lambda s: None)
    monkeypatch.setattr(drivers.bench.devices, "open_bus", lambda config: EmulatedBus(drive, time))
    monkeypatch.setattr(drivers.bench.devices, "ListeningPort", lambda port, clock: port)
    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: GyroPort(time))
    rig = BenchRig(CONFIG, Torque.EMULATED, tmp_path / "raw", time)
    rig.time, rig.drive = time, drive
    return rig


def play(rig, ticks, torque=lambda k: 10 * math.sin(k / 20)):
    return [rig.exchange(rig.clock.now_s(), torque(k)) for k in range(ticks)]


def test_a_file_that_says_the_devices_were_otherwise_is_told_key_by_key(bench, tmp_path):
    with bench.opened(), bench.armed():
        play(bench, 20)
    replay = ReplayRig(tmp_path / "raw" / "wire.cap")
    assert replay.differences(replay.config) == []
    other = replay.config.model_copy(
        update={
            "gyroscope": replay.config.gyroscope.model_copy(
                update={"port": "/dev/ttyS9", "invert": True, "settings": {"filter_hz": 131}}
            )
        }
    )
    told = replay.differences(other)
    assert "bench.gyroscope.invert: True (the capture has False)" in told
    assert any(text.startswith("bench.gyroscope.settings.filter_hz: 131 ") for text in told)
    assert not any("port" in text for text in told)


def test_replay_gives_bit_identical_samples(bench, tmp_path):
    with bench.opened(), bench.armed():
        live = play(bench, 400)
    replay = ReplayRig(tmp_path / "raw" / "wire.cap")
    with replay.opened(), replay.armed():
        again = play(replay, 400)
    assert sum(len(e.gyro) for e in live) > 300
    assert sum(len(e.torque) for e in live) > 300
    for a, b in zip(live, again, strict=True):
        assert np.array_equal(np.array(a.gyro), np.array(b.gyro), equal_nan=True)
        assert a.torque == b.torque
        assert a.channels == b.channels
    with pytest.raises(RecordingError, match="was cut short"):
        replay.exchange(0.0, 0.0)
    assert replay.expected_delay == bench.expected_delay


@pytest.mark.parametrize(
    ("source", "told"),
    [
        ("auto", "torque as the drive reports it, stamped by its own clock"),
        ("sent", "torque timed when it was sent"),
    ],
)
def test_what_is_taken_off_both_roads_is_told_and_no_delay_expected(bench, source, told):
    with bench.opened(), bench.armed():
        play(bench, 50)
        chosen = bench.amplifier.config.model_copy(update={"torque_source": source})
        expected = BenchRetiming(chosen, bench.gyroscope, bench.amplifier).expected_delay()
    assert expected.delay_s == 0.0
    assert expected.corrections[0] == "gyro group delay 2.2 ms"
    assert expected.corrections[-1] == told


def played_in_two_sets(bench):
    """A rest, a whole set, a rest, and a set that a kill cuts short; what came in during each set, and its start."""
    found = []
    with bench.opened(), bench.armed():
        for ticks in (400, 300):
            play(bench, 30, lambda k: 0.0)
            start_s = bench.clock.now_s()
            bench.begin_set(math.sin, start_s)
            found.append((start_s, play(bench, ticks)))
            if ticks == 400:
                bench.end_set()
    return found


def test_a_capture_alone_gives_every_set_as_it_was_heard(bench, tmp_path):
    live = played_in_two_sets(bench)
    recording = recording_from_capture(tmp_path / "raw" / "wire.cap")
    assert [run.name for run in recording.runs] == ["set 1", "set 2"]
    assert recording.info["expected_torque_delay"] == bench.expected_delay._asdict()
    for run, (start_s, answers) in zip(recording.runs, live, strict=True):
        gyro = [s for answer in answers for s in answer.gyro if s.time_s >= start_s]
        torque = [s for answer in answers for s in answer.torque if s.time_s >= start_s]
        assert run.rate_rad_s.tolist() == [s.rate_rad_s for s in gyro]
        assert run.valid.tolist() == [s.valid for s in gyro]
        assert run.torque_nm.tolist() == [s.torque_nm for s in torque]
        assert run.torque_hold == "zero_order"
        assert (run.rate_corner_hz, run.rate_delay_s) == bench.rate_low_pass
        assert set(run.channels) == {"drive_torque_nm", "sent_torque_nm"}
        # Stamped anew by all that was heard, which moves no stamp by more than the clocks were unsure of.
        assert run.time_s == pytest.approx([s.time_s - start_s for s in gyro], abs=1e-3)


def test_a_capture_without_a_set_or_with_records_of_no_kind_is_refused(bench, tmp_path):
    with bench.opened(), bench.armed():
        play(bench, 30)
    path = tmp_path / "raw" / "wire.cap"
    with pytest.raises(RecordingError, match="ends before the first sample of a set"):
        recording_from_capture(path)
    path.write_bytes(path.read_bytes().replace(b'"opened"', b'"closed"'))
    with pytest.raises(RecordingError, match="nothing was played"):
        recording_from_capture(path)


def test_a_mark_that_says_nonsense_is_refused(bench, tmp_path):
    played_in_two_sets(bench)
    path = tmp_path / "raw" / "wire.cap"
    path.write_bytes(path.read_bytes().replace(b'"start_s": 1', b'"start_x": 1'))
    with pytest.raises(RecordingError, match="not in the format of this version"):
        recording_from_capture(path)


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


def test_vanished_gyro_stops_the_next_tick_before_any_torque(bench):
    with bench.opened(), pytest.raises(DeviceFault, match="wire has vanished"), bench.armed():
        play(bench, 20, lambda k: 5.0)
        assert bench.drive.torque_nm == 5.0
        bench._devices.line._port.vanished = True
        with pytest.raises(DeviceFault):
            bench.exchange(bench.time(), 5.0)
        bench.exchange(bench.time(), 7.0)
    assert bench.drive.torque_nm == 0.0


def test_all_that_is_wrong_is_listed_at_once(bench, monkeypatch):
    class Silent(GyroPort):
        def read(self):
            return b""

    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: Silent(bench.time))
    bench.drive.receive = lambda frame, now_s: None
    with pytest.raises(DeviceFault, match=r"(?s)2 faults on the bench.*does not answer.*no byte in 1"), bench.opened():
        pass


def test_who_stops_it_while_devices_are_contacted_is_no_fault_of_a_device(bench, monkeypatch):
    def stopped(path, baud):
        raise Aborted("Stopped by Ctrl-C.")

    monkeypatch.setattr(drivers.bench.devices, "open_port", stopped)
    bench.drive.receive = lambda frame, now_s: pytest.fail("it went on")
    with pytest.raises(Aborted, match="Stopped by Ctrl-C"), bench.opened():
        pass


def test_a_gyro_that_vanishes_while_it_is_contacted_is_told_once(bench, monkeypatch):
    class Killed(GyroPort):
        def read(self):
            self.vanished = self.vanished or self.time.now_s > self.begin_s + 0.5
            return super().read()

    monkeypatch.setattr(drivers.bench.devices, "open_port", lambda path, baud: Killed(bench.time))
    with pytest.raises(DeviceFault) as caught, bench.opened():
        pass
    assert str(caught.value).count("wire has vanished") == 1


def full_disk(monkeypatch):
    def refuse(self, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(SteadyFile, "write", refuse)


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


def test_torque_is_refused_before_arming_and_off_is_safe_at_any_time(bench):
    bench.torque_off()
    bench.disarm()
    bench.close()
    with pytest.raises(DeviceFault, match="not armed"):
        bench.exchange(0.0, 1.0)
    with pytest.raises(DeviceFault, match="before it is open"):
        bench.arm()


def test_report_tells_of_both_devices(bench):
    with bench.opened(), bench.armed():
        play(bench, 50)
        report = bench.report()
    assert report.gyro.lost == 0
    assert report.gyro.rate_hz == pytest.approx(2000, rel=0.05)
    assert "watchdog of 100 ms set in the drive and read back" in report.amplifier_notes
    assert "ordinary scheduling" in report.real_time


def test_replay_stamps_its_sets_anew_exactly_as_the_bench_did(bench, tmp_path):
    def play_set(rig, start_s, ticks):
        rig.begin_set(lambda t: 0.0, start_s)
        for k in range(ticks):
            now_s = rig.clock.now_s()
            bench.time.now_s += 1e-3 if rig is bench else 0.0
            rig.exchange(now_s, math.sin(k / 20))
        rig.end_set()

    found = []
    for make in (lambda: bench, lambda: ReplayRig(tmp_path / "raw" / "wire.cap")):
        rig = make()
        with rig.opened(), rig.armed():
            play_set(rig, 3.0, 6000)
            play_set(rig, 9.5, 2000)
        found.append(rig.corrections())
    live, again = found
    assert len(live) == 2
    assert [len(one.samples[0]) > 10 and len(one.torque[0]) > 10 for one in live] == [True, True]
    assert live == again


def test_a_bench_that_was_never_opened_has_nothing_to_better(bench):
    assert bench.corrections() == ()


def test_torque_that_is_recorded_as_it_was_sent_needs_no_drives_clock(bench):
    bench.amplifier.config = bench._retiming._config = CONFIG.amplifier.model_copy(update={"torque_source": "sent"})
    with bench.opened(), bench.armed():
        bench.begin_set(lambda t: 0.0, 3.0)
        for _ in range(6000):
            bench.time.now_s += 1e-3
            bench.exchange(bench.clock.now_s(), 0.0)
        bench.end_set()
    (one,) = bench.corrections()
    assert len(one.samples[0]) > 10
    assert one.torque == ((), ())
