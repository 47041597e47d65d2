"""The emulators against the wire and against the plant, without a process."""

import math

import numpy as np
import pytest

from drivers.codecs import cia402, odrive_cansimple, stim300
from drivers.codecs.framing import StreamFramer
from drivers.codecs.lawicel import CanFrame
from drivers.codecs.odrive_cansimple import Command
from rig.dynamics import TorqueSignal
from rig.platform import Platform
from sim_backend.emulators.adapter import LawicelAdapter
from sim_backend.emulators.drive import Cia402Drive
from sim_backend.emulators.gyro import GyroSettings, Stim300Emulator, flat_low_pass
from sim_backend.emulators.odrive import OdriveAxis
from sim_backend.emulators.world import World
from tests.rig.dynamics.exact import moved_by_a_held_torque


def settings(**changed):
    given = {
        "sample_rate_hz": 2000.0, "baud": 921_600, "axis": "z", "invert": False, "noise_deg_s": 0.0,
        "bias_deg_s": 0.0, "drift_ppm": 0.0, "start_up_s": 0.0, "seed": 1, "settings": {"datagram": 0x90},
    }  # fmt: skip
    return GyroSettings(**{**given, **changed})


def decoded(raw):
    [(_, packet)] = StreamFramer(stim300.datagram_matcher((0x90,), False)).feed(raw)
    return stim300.decode_datagram(packet)


def test_gyro_starts_up_as_the_real_one_and_then_tells_the_rate():
    gyro = Stim300Emulator(settings(start_up_s=1e-3, invert=True))
    first = decoded(gyro.sample(0.5))
    assert (first.gyro_status, first.rate_deg_s[2]) == (0b0100_0000, 480.0)
    later = decoded(gyro.sample(0.5))
    assert later.gyro_status == 0
    assert later.rate_deg_s == pytest.approx((0.0, 0.0, -math.degrees(0.5)), abs=1e-4)
    assert (later.counter - first.counter) % 256 == 1


def test_gyro_overload_is_flagged_for_its_axis():
    datagram = decoded(Stim300Emulator(settings()).sample(math.radians(430.0)))
    assert not stim300.axis_is_good(datagram.gyro_status, "z")
    assert stim300.axis_is_good(datagram.gyro_status, "x")


def test_gyro_sends_each_datagram_as_late_as_it_says_in_it():
    gyro = Stim300Emulator(settings())
    sent_late_s, said_s = [], []
    for _ in range(6):
        sent_late_s.append(gyro.latency_s)
        said_s.append(decoded(gyro.sample(0.0)).latency_us * 1e-6)
    assert sent_late_s == said_s
    assert len(set(said_s)) == 2, "it is not the same for all"


@pytest.mark.parametrize("corner_hz", [16, 33, 66, 131, 262])
def test_gyro_filter_has_the_delay_and_corner_of_the_data_sheet_and_a_flat_pass_band(corner_hz):
    step_s = 1e-4
    delay_s = stim300.GROUP_DELAY_S[corner_hz]
    kernel = flat_low_pass(delay_s, corner_hz, step_s)
    t = step_s * np.arange(len(kernel))

    def response(hz):
        return np.sum(kernel * np.exp(-2j * np.pi * hz * t))

    assert np.sum(kernel) == pytest.approx(1.0)
    assert abs(response(corner_hz)) == pytest.approx(math.sqrt(0.5), abs=1e-3)
    assert abs(response(corner_hz / 10)) == pytest.approx(1.0, abs=1e-4 if corner_hz > 200 else 5e-3)
    low_hz = corner_hz / 10
    assert -np.angle(response(low_hz)) / (2 * np.pi * low_hz) == pytest.approx(delay_s, abs=0.5 * step_s)


def test_world_takes_a_torque_at_any_instant_with_its_exact_impulse():
    """A free inertia: its rate is the impulse over J, wherever on the grid the torque changes."""
    world = World(Platform(0.5, 0.0, 0.0), start_s=10.0, step_s=1e-3)
    world.change_torque(10.00025, 4.0)
    world.change_torque(10.00535, -1.0)
    rates = world.advance(3) + world.advance(7)
    impulse = 4.0 * (0.00535 - 0.00025) - 1.0 * (0.010 - 0.00535)
    assert rates[-1] == pytest.approx(impulse / 0.5)


def test_world_moves_alike_in_many_calls_and_in_one():
    platform = Platform(0.0203, 0.0447, 681.2, effects={"coulomb_friction": {"level": 1.0}})
    at_once, singly = (World(platform, start_s=0.0, step_s=1e-4) for _ in range(2))
    for world in (at_once, singly):
        for time_s, torque_nm in ((0.33e-3, 4.0), (0.7e-3, -3.0), (0.75e-3, 8.0), (1.2e-3, 0.0)):
            world.change_torque(time_s, torque_nm)
    rates = at_once.advance(20)
    assert len(rates) == 20
    assert rates == [rate for _ in range(20) for rate in singly.advance(1)]


@pytest.mark.parametrize("late_s", [0.0, 1.3e-5, 5e-5, 8e-5])
def test_world_rings_as_it_should_wherever_on_its_grid_the_torque_changes(late_s):
    platform = Platform(inertia_kg_m2=0.0203, damping_nm_s_rad=0.0447, stiffness_nm_rad=681.2)
    changes = np.concatenate([[0.0], late_s + 1e-3 * np.arange(1, 501)])
    torque = TorqueSignal(changes, 40.0 * np.sin(2 * np.pi * 9 * changes), "zero_order")
    world = World(platform, start_s=0.0, step_s=1e-4)
    for time_s, torque_nm in zip(changes, torque.torque_nm, strict=True):
        world.change_torque(time_s, torque_nm)
    rates = np.array([world.advance(5)[-1] for _ in range(1000)])
    exact = moved_by_a_held_torque(platform, torque, 5e-4 * np.arange(1001))[1:]
    assert np.max(np.abs(rates - exact)) < 2e-6 * np.max(np.abs(exact))


def test_adapter_answers_as_the_manual_says():
    seen = []
    adapter = LawicelAdapter(seen.append, lambda: 1.5)
    assert adapter.feed(b"O\r") == b"\a", "no bit rate yet"
    assert adapter.feed(b"S8\rZ1\rO\r") == b"\r\r\r"
    assert adapter.feed(b"S6\r") == b"\a", "not while open"
    assert adapter.feed(b"t1232AABB\rT1FFFFFFF0\r") == b"z\rZ\r"
    assert [frame.identifier for frame in seen] == [0x123, 0x1FFFFFFF]
    assert adapter.to_host(CanFrame(0x181, b"\x01")) == b"t18110105DC\r"
    assert adapter.feed(b"t12x\rF\rV\rC\r") == b"\aF00\rV1013\r\r"
    assert adapter.to_host(CanFrame(0x181, b"\x01")) == b""


def enabled_drive():
    drive = Cia402Drive(1, 100.0, 150.0)
    now = 5.0
    for data in ("2B40600006000000", "2B40600007000000", "2F6060000A000000", "2B4060000F000000"):
        drive.receive(CanFrame(0x601, bytes.fromhex(data)), now)
    drive.receive(CanFrame(0, bytes([1, 1])), now)
    return drive


def write(drive, index, value, now=5.0, size=2, subindex=0):
    head = {1: 0x2F, 2: 0x2B, 4: 0x23}[size]
    data = bytes([head]) + index.to_bytes(2, "little") + bytes([subindex])
    drive.receive(CanFrame(0x601, data + (value & 0xFFFFFFFF).to_bytes(4, "little")[:4]), now)
    return drive.take_frames()[-1].data


def test_drive_limits_the_torque_and_gives_none_unless_enabled():
    idle = Cia402Drive(1, 100.0, 150.0)
    write(idle, cia402.TARGET_TORQUE, 500)
    assert idle.torque_nm == 0.0
    drive = enabled_drive()
    write(drive, cia402.TARGET_TORQUE, 500)
    assert drive.torque_nm == pytest.approx(50.0)
    write(drive, cia402.TARGET_TORQUE, 5000)
    assert drive.torque_nm == pytest.approx(150.0)
    write(drive, cia402.CONTROLWORD, cia402.QUICK_STOP)
    assert drive.torque_nm == 0.0
    assert [e.name for e in drive.take_events(6.0)] == ["enabled", "disabled", "torque_zero"]


@pytest.mark.parametrize(
    ("index", "subindex", "size", "code"),
    [(0x2000, 0, 2, 0x06020000), (0x1018, 9, 4, 0x06090011), (0x6041, 0, 2, 0x06010002), (0x1600, 1, 4, 0x08000022)],
)
def test_drive_aborts_with_the_code_of_the_standard(index, subindex, size, code):
    answer = write(Cia402Drive(1, 100.0, 150.0), index, 1, size=size, subindex=subindex)
    assert (answer[0], int.from_bytes(answer[4:8], "little")) == (0x80, code)


def test_drive_name_comes_in_segments():
    drive = Cia402Drive(1, 100.0, 150.0)
    request = lambda data: (drive.receive(CanFrame(0x601, bytes.fromhex(data)), 0.0), drive.take_frames()[-1].data)[1]  # noqa: E731
    assert request("4008100000000000")[:1] == b"\x41"
    name = b""
    for toggle in ("60", "70", "60", "70"):
        answer = request(toggle + "00" * 7)
        name += answer[1 : 8 - (answer[0] >> 1 & 7)]
        if answer[0] & 1:
            break
    assert name == b"Emulated torque drive"


def test_zero_crossing_of_a_sine_is_no_event_but_lasting_zero_is():
    drive = enabled_drive()
    for k in range(100):
        write(drive, cia402.TARGET_TORQUE, round(100 * math.sin(k / 5)), now=5.0 + k * 1e-3)
    names = [e.name for e in drive.take_events(5.1)]
    assert names == ["enabled"]
    write(drive, cia402.TARGET_TORQUE, 0, now=5.2)
    assert drive.take_events(5.202) == []
    [event] = drive.take_events(5.21)
    assert (event.name, event.time_s, event.after_nm) == ("torque_zero", 5.2, 0.0)
    assert event.as_json()["torque_nm"] == [event.before_nm, 0.0]


def test_odrive_idles_after_an_emergency_stop_until_errors_are_cleared():
    axis = OdriveAxis(0, 5.0)

    def send(command, *values):
        axis.receive(CanFrame(odrive_cansimple.identifier(0, command), odrive_cansimple.encode(command, *values)), 1.0)

    send(Command.SET_CONTROLLER_MODE, 1, 1)
    send(Command.SET_AXIS_STATE, 8)
    send(Command.SET_INPUT_TORQUE, 9.0)
    assert axis.torque_nm == 5.0
    send(Command.ESTOP)
    assert axis.torque_nm == 0.0
    send(Command.SET_AXIS_STATE, 8)
    send(Command.SET_INPUT_TORQUE, 1.0)
    assert axis.torque_nm == 0.0
    send(Command.CLEAR_ERRORS)
    send(Command.SET_AXIS_STATE, 8)
    send(Command.SET_INPUT_TORQUE, 1.0)
    assert axis.torque_nm == 1.0
