import itertools
import tomllib
from importlib import import_module
from pathlib import Path

import can
import pytest

from drivers.codecs.lawicel import CanFrame
from drivers.transport.slcan import SlcanBulkBus
from tests.drivers.fake_port import AdapterPort


@pytest.fixture
def port():
    return AdapterPort()


@pytest.fixture
def bus(port):
    bus = SlcanBulkBus(port, answer_timeout_s=0.01)
    yield bus
    bus.shutdown()


def message(can_id=0x123, data=b"\x01\x02", **kwargs):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=can_id > 0x7FF, **kwargs)


def test_open_sets_the_bit_rate_and_opens_the_channel(port, bus):
    assert port.adapter.is_open
    assert port.adapter.bit_rate_code == "S8"
    bus.shutdown()
    assert not port.adapter.is_open


def test_channel_left_open_by_another_program_is_taken_over(port):
    port.adapter.bit_rate_code, port.adapter.is_open = "S4", True
    port.adapter._rest = b"t1238"
    bus = SlcanBulkBus(port, bitrate=500_000)
    assert (port.adapter.bit_rate_code, port.adapter.is_open) == ("S6", True)
    bus.shutdown()


def test_frames_go_out_and_come_in(port, bus):
    bus.send(message(0x18FF1234, b"\x00\x11\x22\x33\x44\x55\x66\x77"))
    bus.send(can.Message(arbitration_id=0x45, is_remote_frame=True, dlc=8, is_extended_id=False))
    assert port.frames[0] == CanFrame(0x18FF1234, bytes.fromhex("0011223344556677"), True, False, 8)
    assert (port.frames[1].remote, port.frames[1].length) == (True, 8)
    port.waiting += port.adapter.to_host(CanFrame(0x7FF, b"abc"))
    got = bus.recv(0)
    assert (got.arbitration_id, bytes(got.data), got.is_rx) == (0x7FF, b"abc", True)
    assert bus.recv(0) is None


def test_frames_of_one_tick_leave_in_one_write(port, bus):
    writes = []
    keep = port.write
    port.write = lambda data, timeout_s=0.1: (writes.append(data), keep(data, timeout_s))
    bus.send_lines([CanFrame(0x201, b"\x0f\x00"), CanFrame(0x80, b"")])
    assert writes == [b"t20120F00\rt0800\r"]
    bus.send_lines([CanFrame(0x80, b"")], urgent=True)
    assert writes[1] == b"\rt0800\r"


def test_refused_frame_is_an_error(port, bus):
    port.adapter.is_open = False
    with pytest.raises(can.CanOperationError, match="refused 1 frame"):
        bus.send(message())


def test_adapter_that_stops_answering_is_an_error(port, bus):
    bus.send(message())
    assert bus.answers_frames
    port.mute = True
    with pytest.raises(can.CanOperationError, match="the adapter has stalled"):
        for _ in range(100_000):
            bus.send(message())


def test_adapter_that_never_answers_frames_is_accepted(port, bus):
    port.mute = True
    for _ in range(50):
        bus.send(message())
    assert bus.answers_frames is None


def test_vanished_adapter_is_an_error_on_both_roads(port, bus):
    port.vanished = True
    with pytest.raises(can.CanOperationError, match="has vanished"):
        bus.recv(0)
    with pytest.raises(can.CanOperationError, match="has vanished"):
        bus.send(message())


def test_stalled_adapter_is_an_error(port, bus):
    port.stuck = True
    with pytest.raises(can.CanOperationError, match="accepts no bytes"):
        bus.send(message())
    port.stuck = False


def test_port_that_is_no_adapter_is_refused_with_what_to_check(port):
    port.mute = True
    with pytest.raises(can.CanInitializationError, match=r"no answer to 'S8'.*slcan"):
        SlcanBulkBus(port, answer_timeout_s=0.01)


def test_bit_rate_that_adapters_do_not_have_is_refused(port):
    with pytest.raises(ValueError, match="bitrate 300000 is not one of"):
        SlcanBulkBus(port, bitrate=300_000)


def test_adapter_time_stamps_are_put_on_the_clock_of_the_host():
    now = [59.990]
    port = AdapterPort(clock=lambda: now[0])
    bus = SlcanBulkBus(port, timestamps=True)
    assert port.adapter.timestamps
    stamps = []
    for _ in range(4):
        port.waiting += port.adapter.to_host(CanFrame(1, b""))
        stamps.append(bus.recv(0).timestamp)
        now[0] += 0.010
    steps = [round(b - a, 3) for a, b in itertools.pairwise(stamps)]
    assert all(step <= 0.011 for step in steps), "the wrap at one minute is not seen as a jump"
    bus.shutdown()


def test_flags_and_version_are_read(port, bus):
    port.adapter.flags = 0x04
    assert bus.status_flags() == "error warning"
    assert bus.version() == "1013"


def test_interface_is_registered_with_python_can():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())
    module, _, name = project["project"]["entry-points"]["can.interface"]["slcan_bulk"].partition(":")
    assert getattr(import_module(module), name) is SlcanBulkBus


def test_a_port_that_never_stops_sending_is_no_adapter(port, monkeypatch):
    monkeypatch.setattr("drivers.transport.slcan.LONGEST_FLUSH_S", 0.01)
    port.wait_readable = lambda timeout_s: True
    port.read = lambda: b"\x90\x00"
    with pytest.raises(can.CanInitializationError, match=r"still sending.*swapped"):
        SlcanBulkBus(port)
