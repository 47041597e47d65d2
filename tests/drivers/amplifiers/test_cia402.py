import pytest

import drivers.transport.can_link
from drivers.amplifiers import make_amplifier
from drivers.codecs import cia402
from drivers.codecs.cia402 import State
from drivers.codecs.lawicel import CanFrame
from drivers.transport.can_link import CanLink
from rig.config.bench import AmplifierConfig
from rig.errors import ConfigError, DeviceFault
from sim_backend.emulators.drive import Cia402Drive
from tests.drivers.emulated_bus import EmulatedBus, FakeTime


@pytest.fixture(autouse=True)
def no_sleeping(monkeypatch):
    monkeypatch.setattr(drivers.transport.can_link.time, "sleep", lambda s: None)


class Bench:
    """An amplifier driver, a link and the drive at its other end."""

    def __init__(self, settings=None, **config):
        self.time = FakeTime()
        self.drive = Cia402Drive(5, rated_torque_nm=120.0, peak_torque_nm=150.0)
        self.bus = EmulatedBus(self.drive, self.time)
        self.link = CanLink(self.bus, self.time)
        self.amplifier = make_amplifier(AmplifierConfig(node=5, settings=settings or {}, **config))

    def tick(self, torque_nm):
        now_s = self.time()
        self.link.send(self.amplifier.frames(torque_nm, now_s))
        self.link.poll()
        self.amplifier.check(now_s)

    def armed(self):
        self.amplifier.contact(self.link)
        self.amplifier.arm(self.link)
        return self


@pytest.fixture
def bench():
    return Bench()


def test_contact_sets_watchdog_and_mapping_and_says_so(bench):
    notes = bench.amplifier.contact(bench.link)
    assert notes[0] == "cyclic synchronous torque, steps of 0.12 N m, peak 150 N m"
    assert "watchdog of 100 ms set in the drive and read back" in notes
    od = bench.drive.od
    assert od.get(0x1016, 1) == 127 << 16 | 100
    assert [od.get(0x1600, k) for k in (0, 1, 2)] == [2, 0x60400010, 0x60710010]
    assert [od.get(0x1A00, k) for k in range(4)] == [3, 0x60410010, 0x60770010, 0x10130020]
    assert bench.drive.torque_nm == 0.0


def test_armed_drive_follows_the_torque_in_steps_of_a_thousandth_of_rated(bench):
    bench.armed()
    bench.tick(30.05)
    assert bench.drive.torque_nm == pytest.approx(30.0)
    bench.tick(30.07)
    assert bench.drive.torque_nm == pytest.approx(30.12)
    bench.tick(30.07)
    assert bench.amplifier.actual_torque_nm == pytest.approx(30.12)


def test_what_is_recorded_is_read_back_from_the_frame_that_was_sent(bench):
    bench.armed()
    frames = bench.amplifier.frames(12.345, bench.time())
    torques = [bench.amplifier.sent_torque_nm(frame) for frame in frames]
    assert torques[0] == pytest.approx(12.36)
    assert torques[1:] == [None] * (len(frames) - 1)


def test_command_is_limited_to_the_peak_of_the_drive_and_recorded_so(bench):
    bench.armed()
    frames = bench.amplifier.frames(-500.0, bench.time())
    assert bench.amplifier.sent_torque_nm(frames[0]) == pytest.approx(-150.0)


def test_gear_and_sign_apply_both_ways():
    bench = Bench(gear_ratio=4.0, invert=True).armed()
    bench.tick(40.0)
    bench.tick(40.0)
    assert bench.drive.torque_nm == pytest.approx(-10.0, abs=0.07)
    assert bench.amplifier.actual_torque_nm == pytest.approx(40.0, abs=0.3)
    assert bench.amplifier.peak_torque_nm == pytest.approx(600.0)


def test_heartbeat_goes_out_only_with_the_ticks(bench):
    bench.armed()
    bench.bus.sent.clear()
    for _ in range(1000):
        bench.tick(1.0)
    beats = [f for f in bench.bus.sent if f.identifier == 0x77F]
    assert len(beats) >= 4
    bench.bus.sent.clear()
    bench.time.now_s += 10.0
    bench.link.poll()
    assert bench.bus.sent == [], "nothing is sent behind the back of the loop"


def test_hung_loop_makes_the_drive_cut_the_torque_and_the_next_tick_says_why(bench):
    bench.armed()
    bench.tick(50.0)
    bench.time.now_s += 0.11
    bench.drive.tick(bench.time.now_s)
    assert bench.drive.torque_nm == 0.0
    events = bench.drive.take_events(bench.time.now_s)
    watchdog = next(e for e in events if e.name == "watchdog")
    assert (watchdog.before_nm, watchdog.after_nm) == (pytest.approx(50.04), 0.0)
    with pytest.raises(DeviceFault, match=r"EMCY 0x8130.*no longer hears this computer"):
        bench.tick(50.0)


def test_emergency_is_told_in_words(bench):
    bench.armed()
    bench.drive.fail(0x4310, bench.time.now_s)
    with pytest.raises(DeviceFault, match="0x4310 over-temperature of the drive"):
        bench.tick(1.0)


def test_drive_that_was_reset_is_noticed(bench):
    bench.armed()
    bench.tick(10.0)
    bench.drive.receive(CanFrame(0, bytes([0x82, 5])), bench.time.now_s)
    with pytest.raises(DeviceFault, match="left NMT state operational"):
        bench.tick(10.0)
    assert bench.drive.torque_nm == 0.0


def test_silent_drive_is_a_fault_within_three_heartbeats(bench):
    bench.armed()
    bench.tick(10.0)
    bench.bus.silent = True
    bench.time.now_s += 0.16
    with pytest.raises(DeviceFault, match=r"is silent: no heartbeat for 1[56]. ms"):
        bench.tick(10.0)


def test_disarm_reads_back_that_the_drive_is_off(bench):
    bench.armed()
    bench.tick(50.0)
    bench.amplifier.disarm(bench.link)
    assert bench.drive.torque_nm == 0.0
    assert bench.amplifier.state is not State.ENABLED


def test_drive_that_cannot_be_shown_to_be_off_is_said_loudly(bench):
    bench.armed()
    bench.drive.od.write = lambda *_: None  # a drive that ignores whatever it is told,
    bench.drive.on_heartbeat_lost = lambda now_s: None  # and that nobody speaks to it any more
    with pytest.raises(DeviceFault, match="PRESS THE EMERGENCY STOP"):
        bench.amplifier.disarm(bench.link)


def test_off_frames_take_the_torque_away_at_once(bench):
    bench.armed()
    bench.tick(50.0)
    bench.link.send(bench.amplifier.off_frames(), urgent=True)
    assert bench.drive.torque_nm == 0.0


def test_fault_is_reset_when_arming(bench):
    bench.amplifier.contact(bench.link)
    bench.drive.fail(0x3210, bench.time.now_s)
    bench.amplifier.arm(bench.link)
    assert bench.amplifier.state is State.ENABLED


def test_drive_that_never_gets_ready_says_what_to_check(bench):
    bench.amplifier.contact(bench.link)
    bench.drive._follow = lambda *_: None
    with pytest.raises(DeviceFault, match=r"'switch on disabled' after 1.5 s.*check its DC supply"):
        bench.amplifier.arm(bench.link)


def test_absent_drive_is_named_with_what_to_check(bench):
    bench.bus.silent = True
    with pytest.raises(DeviceFault, match=r"node 5 does not answer.*node number, CAN bit rate"):
        bench.amplifier.contact(bench.link)


def test_drive_without_heartbeat_consumer_is_refused(bench):
    keep = bench.drive.od.write
    bench.drive.od.write = lambda i, s, d: None if i == 0x1016 else keep(i, s, d)
    with pytest.raises(DeviceFault, match="keep driving if this computer fails"):
        bench.amplifier.contact(bench.link)


def test_units_of_makers_are_settings():
    bench = Bench({"rated_torque_unit_nm": 1e-6, "peak_torque_nm": 0.1})
    bench.amplifier.contact(bench.link)
    assert bench.amplifier.peak_torque_nm == pytest.approx(0.1)
    declared = Bench({"reference_torque_nm": 60.0})
    declared.armed()
    declared.tick(30.0)
    assert declared.drive.od.get(cia402.TARGET_TORQUE) == 500


def test_without_sync_every_frame_acts_at_once():
    bench = Bench({"sync": False}).armed()
    bench.tick(24.0)
    assert bench.drive.torque_nm == pytest.approx(24.0)
    assert all(frame.identifier != 0x80 for frame in bench.bus.sent)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"device": "cia401"}, "there are cia402, odrive, moteus, vesc"),
        ({"node": 0}, "0 is not a CANopen node"),
        ({"node": 127}, "host_node: 127 is the drive's own"),
        ({"settings": {"mode": "position"}}, "settings.mode"),
        ({"settings": {"on_lost_host": 0}}, "on_lost_host: 0 is not allowed"),
    ],
)
def test_settings_that_cannot_work_are_refused(config, message):
    with pytest.raises(ConfigError, match=message):
        make_amplifier(AmplifierConfig(**config))


@pytest.mark.parametrize("text", ["x" * 100_000, "[FileInfo]\n" + "x" * 100_000, "[" + "x y " * 25_000])
def test_of_an_eds_that_is_a_single_long_line_no_more_is_quoted_than_can_be_read(tmp_path, text):
    path = tmp_path / "long.eds"
    path.write_text(text)
    with pytest.raises(ConfigError, match="cannot be read as EDS") as caught:
        make_amplifier(AmplifierConfig(settings={"eds": str(path)}))
    assert len(str(caught.value)) < len(str(path)) + 300 and "\n" not in str(caught.value)


def test_missing_eds_is_a_configuration_error_before_anything_is_opened(tmp_path):
    with pytest.raises(ConfigError, match=r"bench.amplifier.settings.eds: there is no file"):
        make_amplifier(AmplifierConfig(settings={"eds": str(tmp_path / "none.eds")}))
    broken = tmp_path / "broken.eds"
    broken.write_text("this is no EDS")
    with pytest.raises(ConfigError, match="cannot be read as EDS"):
        make_amplifier(AmplifierConfig(settings={"eds": str(broken)}))


def without(bench, *objects):
    """Take objects away from the drive."""
    for index in objects:
        del bench.drive.od._od[index]
    return bench


def test_a_drive_without_a_reaction_to_a_lost_computer_is_refused_at_contact(bench):
    with pytest.raises(DeviceFault, match=r"has no 0x6007 and no 0x1029, so it would not cut the torque"):
        without(bench, cia402.ABORT_CONNECTION_OPTION).amplifier.contact(bench.link)
