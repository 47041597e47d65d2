import math
import struct

import can
import pytest

import drivers.transport.can_link
from drivers.amplifiers import make_amplifier, moteus, vesc
from drivers.codecs.lawicel import CanFrame
from drivers.transport.can_link import CanLink, ReceivedFrame
from rig.config.bench import AmplifierConfig, CanConfig
from rig.errors import ConfigError, DeviceFault
from sim_backend.emulators.odrive import OdriveAxis
from tests.drivers.emulated_bus import EmulatedBus, FakeTime
from tests.drivers.wire import vectors

MOTEUS_REPLIES = [v for v in vectors("mjbots") if v["hex"].startswith("24")]


@pytest.fixture(autouse=True)
def no_sleeping(monkeypatch):
    monkeypatch.setattr(drivers.transport.can_link.time, "sleep", lambda s: None)


class Bench:
    def __init__(self, device, drive, **config):
        self.time, self.drive = FakeTime(), drive
        self.bus = EmulatedBus(drive, self.time)
        self.link = CanLink(self.bus, self.time)
        self.amplifier = make_amplifier(AmplifierConfig(device=device, **config))

    def armed(self):
        self.amplifier.contact(self.link)
        self.amplifier.arm(self.link)
        return self

    def tick(self, torque_nm):
        now_s = self.time()
        self.link.send(self.amplifier.frames(torque_nm, now_s))
        self.link.poll()
        self.amplifier.check(now_s)


def odrive(watchdog_s=0.1, **settings):
    return Bench(
        "odrive", OdriveAxis(3, 20.0, 0.5, watchdog_s), node=3,
        settings={"peak_torque_nm": 15.0, "torque_constant_nm_a": 0.5, **settings},
    )  # fmt: skip


def test_odrive_follows_the_torque_and_reports_its_own():
    bench = odrive().armed()
    bench.tick(4.0)
    bench.tick(4.0)
    assert bench.drive.torque_nm == pytest.approx(4.0)
    assert bench.amplifier.actual_torque_nm == pytest.approx(4.0)
    frames = bench.amplifier.frames(99.0, bench.time())
    assert bench.amplifier.sent_torque_nm(frames[0]) == pytest.approx(15.0)
    bench.amplifier.disarm(bench.link)
    assert bench.drive.torque_nm == 0.0


def test_odrive_whose_watchdog_is_off_as_delivered_is_refused():
    with pytest.raises(DeviceFault, match=r"enable_watchdog = True, watchdog_timeout = 0\.1"):
        odrive(watchdog_s=0.0).armed()


def test_odrive_cuts_the_torque_when_the_loop_hangs():
    bench = odrive().armed()
    bench.tick(4.0)
    bench.time.now_s += 0.2
    bench.drive.tick(bench.time.now_s)
    assert bench.drive.torque_nm == 0.0
    with pytest.raises(DeviceFault, match="left closed loop: idle, watchdog timer expired"):
        for _ in range(2000):
            bench.tick(4.0)


def test_absent_odrive_is_named_with_what_to_check():
    bench = odrive()
    bench.bus.silent = True
    with pytest.raises(DeviceFault, match="ODrive, node 3 is silent"):
        bench.amplifier.contact(bench.link)


@pytest.mark.parametrize("vector", MOTEUS_REPLIES, ids=[v["id"] for v in MOTEUS_REPLIES])
def test_moteus_reply_of_the_documentation_decodes(vector):
    registers = moteus.decode_registers(bytes.fromhex(vector["hex"]))
    want = vector["decoded"]
    torque = want["torque"] if "torque" in want else want["torque_int16"] * 0.01
    assert registers[moteus._MODE] == want["mode"]
    assert registers[moteus._TORQUE] == pytest.approx(torque)


def test_moteus_command_is_torque_without_gains():
    body = moteus.encode_torque(-0.3, 0.05)
    assert body[:3] == bytes.fromhex("01000a")
    position, velocity = struct.unpack_from("<ff", body, 5)
    assert math.isnan(position)
    assert velocity == 0.0
    assert struct.unpack_from("<fff", body, 16) == pytest.approx((-0.3, 0.0, 0.0))
    assert len(moteus.padded(body)) in moteus._FD_LENGTHS


class FakeMoteus:
    """Answers each command with its mode and torque; its watchdog latches, where it has one."""

    def __init__(self, watchdog=True):
        self.mode, self.torque_nm, self.out = moteus.MODE_TIMEOUT, 0.0, []
        self.watchdog, self.fed_s = watchdog, 0.0

    def receive(self, frame, now_s):
        commands = frame.data[0] == moteus._WRITE_I8_1
        if self.watchdog and self.mode == moteus.MODE_POSITION and now_s - self.fed_s > 0.1:
            self.mode = moteus.MODE_TIMEOUT
        if commands:
            self.fed_s = now_s
            wanted = frame.data[2]
            if self.mode != moteus.MODE_TIMEOUT or wanted == moteus.MODE_STOPPED:
                self.mode = wanted
        if not commands or len(frame.data) < 20:
            self.torque_nm = 0.0
            self.answer()
            return
        self.torque_nm = struct.unpack_from("<f", frame.data, 16)[0] if self.mode == 10 else 0.0
        self.answer()

    def answer(self):
        body = bytes([0x21, 0, self.mode, 0x2D, 3]) + struct.pack("<f", self.torque_nm) + bytes([0x21, 0xF, 0])
        self.out.append(CanFrame(7 << 8, body, extended=True, fd=True))

    def tick(self, now_s):
        pass

    def take_frames(self):
        out, self.out = self.out, []
        return out


def test_moteus_clears_a_latched_timeout_and_runs():
    bench = Bench(
        "moteus", FakeMoteus(), node=7, can=CanConfig(interface="virtual", channel="x"),
        settings={"peak_torque_nm": 2.0},
    ).armed()  # fmt: skip
    bench.tick(1.5)
    assert bench.drive.torque_nm == pytest.approx(1.5)
    frames = bench.amplifier.frames(1.25, bench.time())
    assert bench.amplifier.sent_torque_nm(frames[0]) == pytest.approx(1.25)
    bench.drive.mode = moteus.MODE_TIMEOUT
    with pytest.raises(DeviceFault, match=r"mode 11\): its watchdog expired"):
        bench.tick(1.0)
    bench.amplifier.disarm(bench.link)


def test_moteus_whose_watchdog_does_nothing_is_refused():
    bench = Bench(
        "moteus", FakeMoteus(watchdog=False), node=7, can=CanConfig(interface="virtual", channel="x"),
    )  # fmt: skip
    with pytest.raises(DeviceFault, match="keeps running although this computer stopped sending"):
        bench.armed()
    assert bench.drive.mode == moteus.MODE_STOPPED


def test_moteus_on_a_classic_can_adapter_is_refused():
    with pytest.raises(ConfigError, match="needs CAN-FD"):
        make_amplifier(AmplifierConfig(device="moteus"))


def vesc_config(**settings):
    given = {"torque_constant_nm_a": 0.1, "peak_current_a": 50.0, "timeout_is_set": True, **settings}
    return AmplifierConfig(device="vesc", node=11, settings=given)


def test_vesc_takes_current_in_milliamperes_and_reports_amperes():
    driver = make_amplifier(vesc_config())
    [frame] = driver.frames(2.0, 0.0)
    assert (frame.identifier, frame.extended) == (0x10B, True)
    assert frame.data == (20_000).to_bytes(4, "big")
    assert driver.sent_torque_nm(frame) == pytest.approx(2.0)
    assert vesc.decode_status(struct.pack(">ihh", 1234, -205, 500)) == (1234.0, -20.5, 0.5)
    assert driver.peak_torque_nm == pytest.approx(5.0)


def test_vesc_without_a_confirmed_timeout_is_refused():
    with pytest.raises(ConfigError, match="set the VESC's timeout to 100 ms"):
        make_amplifier(vesc_config(timeout_is_set=False))


def test_vesc_reports_its_hottest_spot_and_its_current():
    driver = make_amplifier(vesc_config())
    assert driver.readings == {}
    driver.receive(ReceivedFrame(0.0, CanFrame(9 << 8 | 11, struct.pack(">ihh", 0, 125, 0), extended=True)))
    driver.receive(ReceivedFrame(0.0, CanFrame(16 << 8 | 11, struct.pack(">hhhh", 412, 655, 0, 0), extended=True)))
    assert driver.readings == {"drive_current_a": 12.5, "drive_temperature_c": 65.5}


def test_a_bus_full_of_errors_is_a_fault_and_a_few_are_not():
    time = FakeTime()
    bus = EmulatedBus(OdriveAxis(3, 20.0), time)
    link = CanLink(bus, time)
    errors = [can.Message(is_error_frame=True)] * 15
    bus._recv_internal = lambda timeout: (errors.pop() if errors else None, False)
    assert link.poll() == []
    errors += [can.Message(is_error_frame=True)] * 15
    with pytest.raises(DeviceFault, match=r"error frames within 0\.1 s \(limit 20\): check termination"):
        link.poll()


def test_an_adapter_that_went_off_the_bus_is_a_fault_at_its_first_word_where_it_says_so():
    socketcan = type("SocketcanBus", (EmulatedBus,), {"__module__": "can.interfaces.socketcan.socketcan"})
    for made, faulty in ((socketcan, True), (EmulatedBus, False)):
        time = FakeTime()
        bus = made(OdriveAxis(3, 20.0), time)
        link = CanLink(bus, time)
        frames = [can.Message(is_error_frame=True, arbitration_id=0x40)]
        bus._recv_internal = lambda timeout, frames=frames: (frames.pop() if frames else None, False)
        if faulty:
            with pytest.raises(DeviceFault, match="off the bus"):
                link.poll()
        else:
            assert link.poll() == []
