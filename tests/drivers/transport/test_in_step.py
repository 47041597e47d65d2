"""A port in step: bytes carry the instant at which they were sent, however late and in what pieces they come."""

import sys
import threading
import time

import pytest

from drivers.transport.in_step import InStepPort, listening
from drivers.transport.listening import ListeningPort
from drivers.transport.socket_port import SocketPort
from rig.clock import MonotonicClock
from rig.errors import DeviceFault
from sim_backend.emulators.socket_port import SocketListener

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="local sockets")


class Steps:
    """A clock in step whose other end is the test: at each step it sends what is due by then."""

    def __init__(self):
        self.time_s, self.lines, self.due = 1000.0, [], []

    def now_s(self):
        return self.time_s

    def wait_until(self, deadline_s):
        self.time_s = max(self.time_s, deadline_s)
        for at_s, send in [one for one in self.due if one[0] <= self.time_s]:
            self.due.remove((at_s, send))
            self.lines[0].stamp([(at_s, send())], False, 5.0)
        return self.time_s

    def pause(self, duration_s):
        self.wait_until(self.time_s + duration_s)

    def join(self, line):
        self.lines.append(line)


@pytest.fixture
def line():
    device, steps = SocketListener(), Steps()
    port = listening(SocketPort(device.path), steps)
    device.read()  # takes the connection
    yield device, steps, port
    port.close()
    device.close()


def test_bytes_are_stamped_by_when_they_were_sent_whatever_pieces_they_come_in(line):
    device, steps, port = line
    assert isinstance(port, InStepPort)
    assert steps.lines == [port]
    for piece in (b"ab", b"cde", b"fg"):
        device.write(piece)
        time.sleep(0.002)
    assert port.arrived() == []
    port.stamp([(1000.001, 4), (1000.002, 4), (1000.003, 7)], False, 5.0)
    assert port.arrived() == [(1000.001, b"abcd"), (1000.003, b"efg")]


def test_time_does_not_go_on_before_what_was_sent_has_arrived(line):
    device, _, port = line
    late = threading.Timer(0.05, device.write, [b"late"])
    late.start()
    port.stamp([(1000.001, 4)], False, 5.0)
    late.join()
    assert port.arrived() == [(1000.001, b"late")]


def test_bytes_that_never_come_are_a_fault(line):
    device, _, port = line
    device.write(b"ab")
    with pytest.raises(DeviceFault, match=r"3 bytes that were sent have not arrived within 0.05 s"):
        port.stamp([(1000.001, 5)], False, 0.05)


def test_a_device_that_vanished_is_known_to_have_before_time_goes_on(line):
    device, _, port = line
    device.write(b"last")
    device.close()
    port.stamp([(1000.001, 4)], True, 5.0)
    assert port.arrived() == [(1000.001, b"last")]
    with pytest.raises(DeviceFault, match="vanished"):
        port.arrived()


def test_who_waits_for_bytes_lets_time_pass_until_they_come_or_the_time_is_over(line):
    device, steps, port = line
    steps.due = [(1000.0102, lambda: device.write(b"x") or 1)]
    assert port.wait_readable(0.5)
    assert steps.time_s == pytest.approx(1000.0105)
    assert port.arrived() == [(1000.0102, b"x")]
    assert not port.wait_readable(0.5)
    assert steps.time_s == pytest.approx(1000.5105)


def test_what_is_written_is_counted(line):
    device, _, port = line
    port.write(b"abc")
    port.write(b"de")
    assert port.written_bytes == 5
    assert device.read() == b"abcde"


def test_a_clock_that_is_not_in_step_gets_a_port_that_stamps_on_arrival():
    device = SocketListener()
    port = listening(SocketPort(device.path), MonotonicClock())
    assert type(port) is ListeningPort
    port.close()
    device.close()
