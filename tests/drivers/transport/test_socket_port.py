"""A port on a local socket behaves as a serial one does: bulk, never waiting, and gone when the other end is."""

import sys
import time

import pytest

if sys.platform == "win32":
    pytest.skip("local sockets of this kind are POSIX", allow_module_level=True)

from drivers.transport.ports import SerialPort
from drivers.transport.socket_port import SocketPort, open_port
from rig.errors import DeviceFault
from sim_backend.emulators.pty_port import PtyPort
from sim_backend.emulators.socket_port import SocketListener


@pytest.fixture
def ends():
    listener = SocketListener()
    port = open_port(listener.path, 921_600)
    assert listener.read() == b""  # takes the connection
    yield listener, port
    port.close()
    listener.close()


def test_bytes_go_both_ways_in_bulk_and_nothing_waits(ends):
    listener, port = ends
    assert port.read() == b""
    listener.write(b"x" * 5000)
    assert port.wait_readable(1.0)
    assert port.read() == b"x" * 5000
    port.write(b"t2010\r")
    assert listener.read() == b"t2010\r"
    assert not port.wait_readable(0.0)


def test_a_port_whose_other_end_has_gone_is_a_fault(ends):
    listener, port = ends
    listener.close()
    with pytest.raises(DeviceFault, match="has vanished"):
        port.read()
    with pytest.raises(DeviceFault, match="has vanished"):
        port.write(b"x")


def test_what_nobody_reads_is_lost_and_counted_and_a_full_port_is_a_stall(ends):
    listener, port = ends
    for _ in range(500):
        listener.write(b"y" * 4096)
    assert listener.lost_bytes > 0
    begin_s = time.monotonic()
    with pytest.raises(DeviceFault, match="accepts no bytes"):
        port.write(b"z" * 10_000_000, timeout_s=0.02)
    assert time.monotonic() - begin_s < 1.0


def test_the_next_driver_may_connect_when_the_first_has_gone(ends):
    listener, port = ends
    port.close()
    assert listener.read() == b""
    second = SocketPort(listener.path)
    listener.read()
    listener.write(b"hello")
    assert second.wait_readable(1.0)
    assert second.read() == b"hello"
    second.close()


def test_a_socket_where_nobody_listens_is_a_fault_and_a_path_is_a_serial_port():
    with pytest.raises(DeviceFault, match="Is the emulator running"):
        open_port("unix:/nowhere/port", 115_200)
    terminal = PtyPort()
    port = open_port(terminal.path, 115_200)
    assert isinstance(port, SerialPort)
    port.close()
    terminal.close()
