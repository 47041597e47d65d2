"""A port with an ear of its own keeps stamping while its owner is busy, and tells when the device is gone."""

import os
import sys
import time

import pytest

from drivers.transport.listening import ListeningPort, arrivals
from drivers.transport.ports import SerialPort
from rig.errors import DeviceFault

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo terminals")


@pytest.fixture
def line():
    import pty  # noqa: PLC0415  POSIX only
    import tty  # noqa: PLC0415

    device, port = pty.openpty()
    tty.setraw(port)
    listening = ListeningPort(SerialPort(os.ttyname(port), 921_600))
    yield device, listening
    listening.close()
    for descriptor in (device, port):
        try:
            os.close(descriptor)
        except OSError:
            continue


def test_bytes_carry_the_time_of_their_arrival_not_of_their_reading(line):
    device, port = line
    sent_s = []
    for text in (b"one", b"two"):
        sent_s.append(time.monotonic())
        os.write(device, text)
        time.sleep(0.1)
    asked_s = time.monotonic()
    chunks = arrivals(port, time.monotonic)
    assert b"".join(data for _, data in chunks) == b"onetwo"
    assert sent_s[0] <= chunks[0][0] <= asked_s - 0.05
    assert arrivals(port, time.monotonic) == []


def test_waiting_ends_when_something_comes(line):
    device, port = line
    assert not port.wait_readable(0.01)
    os.write(device, b"x")
    assert port.wait_readable(2.0)
    assert port.read() == b"x"
    port.write(b"back")
    assert os.read(device, 10) == b"back"


def test_a_device_that_vanishes_is_a_fault_after_what_it_still_said(line):
    device, port = line
    os.write(device, b"last words")
    assert port.wait_readable(2.0)
    os.close(device)
    port._thread.join(2.0)
    assert port.read() == b"last words"
    with pytest.raises(DeviceFault, match="has vanished"):
        port.read()
