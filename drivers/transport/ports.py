"""Byte ports: non-blocking bulk reads and writes, with one message if the other end disappears.

Drivers talk to the ``BytePort`` protocol, so that a replay or a test can stand in for a serial line.
"""

from __future__ import annotations

import errno
import os
import select
import sys
import time
from collections.abc import Callable
from typing import Any, Protocol

import serial

from rig.errors import DeviceFault

POSIX = sys.platform != "win32"
URL_SIGN = "://"  # anywhere: pyserial splits at the first one
MAX_QUOTED = 200
BULK_BYTES = 65_536
_ONE_READ = 2048


class BytePort(Protocol):
    """A stream of bytes in both directions."""

    @property
    def name(self) -> str:
        """What people call the port: "/dev/ttyUSB0", "COM3"."""
        ...

    def read(self) -> bytes:
        """Everything that has arrived, b"" if nothing has; never waits. Raises DeviceFault if gone."""
        ...

    def write(self, data: bytes, timeout_s: float = 0.1) -> None:
        """Send all bytes. Raises DeviceFault if the port is gone or does not take them in time."""
        ...

    def wait_readable(self, timeout_s: float) -> bool:
        """Wait for bytes at most so long; True if there are some."""
        ...

    def close(self) -> None:
        """Let go of the port; safe twice."""
        ...


def gone(name: str, reason: object) -> DeviceFault:
    """The fault of a port whose other end has vanished."""
    return DeviceFault(
        f"{name} has vanished ({reason}): the device was unplugged, lost power or its adapter reset. "
        "Check cable and supply, then `rig devices`."
    )


class SerialPort:
    """A serial port opened by pyserial and read in bulk.

    On POSIX the file descriptor is read directly: ``Serial.read(n)`` waits for n bytes or the timeout
    and costs several system calls each, which a 1 kHz loop with a 2 kHz stream cannot spare.

    Raises
    ------
    DeviceFault
        If the port cannot be opened, with the ports that do exist.
    """

    def __init__(self, path: str, baud: int, low_latency: bool = True) -> None:
        self._path = path
        try:
            # Exclusive: two programs that read one gyro each get half of its datagrams.
            self._serial = serial.Serial(path, baud, timeout=0, write_timeout=0.1, exclusive=POSIX or None)
        except (serial.SerialException, ValueError, OSError) as problem:
            raise DeviceFault(_cannot_open(path, baud, problem)) from None
        if low_latency:
            self._ask_for_low_latency()
        self._fd: int | None = self._serial.fileno() if POSIX else None
        if self._fd is not None:
            os.set_blocking(self._fd, False)

    @property
    def name(self) -> str:
        """Path of the port."""
        return self._path

    def fileno(self) -> int | None:
        """File descriptor to wait on; None where the system has none for serial ports."""
        return self._fd

    def read(self) -> bytes:
        """Everything that has arrived; never waits."""
        if self._fd is None:
            return self._read_through_pyserial()
        data = part = self._read_once(self._fd)
        while len(part) >= _ONE_READ:  # a tty hands out at most 4095 bytes at a time
            part = self._read_once(self._fd)
            data += part
        return data

    def _read_once(self, fd: int) -> bytes:
        try:
            data = os.read(fd, BULK_BYTES)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise gone(self._path, problem.strerror) from None
        if not data and not self._pretends_to_be_a_tty_without_data():
            raise gone(self._path, "end of file")
        return data

    def _pretends_to_be_a_tty_without_data(self) -> bool:
        # A raw tty with VMIN = VTIME = 0 answers a read without data with 0 bytes instead of EAGAIN;
        # after a hang-up poll() says so, and then the 0 bytes mean that the device is gone.
        assert self._fd is not None
        poller = select.poll()
        poller.register(self._fd, select.POLLIN)
        return not any(event & (select.POLLHUP | select.POLLERR | select.POLLNVAL) for _, event in poller.poll(0))

    def _read_through_pyserial(self) -> bytes:
        try:
            return bytes(self._serial.read(self._serial.in_waiting))
        except (serial.SerialException, OSError) as problem:
            raise gone(self._path, problem) from None

    def write(self, data: bytes, timeout_s: float = 0.1) -> None:
        """Send all bytes within the time, else DeviceFault."""
        if self._fd is None:
            self._write_through_pyserial(data, timeout_s)
            return
        fd, view = self._fd, memoryview(data)
        deadline = 0.0
        while view:
            try:
                view = view[os.write(fd, view) :]
            except BlockingIOError:
                now = time.monotonic()
                deadline = deadline or now + timeout_s
                if now >= deadline:
                    raise stalled(self._path, len(view), timeout_s) from None
                select.select([], [fd], [], deadline - now)
            except OSError as problem:
                raise gone(self._path, problem.strerror) from None

    def _write_through_pyserial(self, data: bytes, timeout_s: float) -> None:
        try:
            self._serial.write_timeout = timeout_s
            self._serial.write(data)
        except serial.SerialTimeoutException:
            raise stalled(self._path, len(data), timeout_s) from None
        except (serial.SerialException, OSError) as problem:
            raise gone(self._path, problem) from None

    def wait_readable(self, timeout_s: float) -> bool:
        """Wait for bytes at most so long."""
        if self._fd is not None:
            return bool(select.select([self._fd], [], [], max(timeout_s, 0.0))[0])
        deadline = time.monotonic() + timeout_s
        while not self._serial.in_waiting:
            if time.monotonic() >= deadline:
                return False
            time.sleep(0.0005)
        return True

    def close(self) -> None:
        """Close; safe twice."""
        self._fd = None
        self._serial.close()

    def _ask_for_low_latency(self) -> None:
        # FTDI adapters hold bytes for 16 ms otherwise; where the driver has no such switch nothing is lost.
        switch: Callable[[bool], Any] | None = getattr(self._serial, "set_low_latency_mode", None)
        if switch is not None:
            try:
                switch(True)
            except (OSError, ValueError, NotImplementedError):
                return


def url_fault(port: str) -> str | None:
    """Why ``port`` is no name of a port where it is a URL, else None.

    pyserial and what is built on it open URLs too, and some of them write files or reach other machines
    (spy://...?file=, socket://, rfc2217://): a configuration from elsewhere must not.
    """
    if URL_SIGN not in port:
        return None
    return f"{port[:MAX_QUOTED]!r} is a URL, and only plain names and paths of ports are taken: /dev/ttyUSB0, COM3"


def is_same_port(one: str, other: str) -> bool:
    """Whether two names mean one port: a link in /dev/serial/by-id leads to it, Windows takes com3 for COM3."""
    try:
        return os.path.normcase(os.path.realpath(one)) == os.path.normcase(os.path.realpath(other))
    except (OSError, ValueError):  # no name of a file
        return one == other


def stalled(name: str, left: int, timeout_s: float) -> DeviceFault:
    """The fault of a port that accepts no more bytes."""
    return DeviceFault(
        f"{name} accepts no bytes: {left} left after {timeout_s * 1e3:.0f} ms. "
        "The adapter has stalled or its line is too slow. Unplug it and plug it in again."
    )


def _cannot_open(path: str, baud: int, problem: Exception) -> str:
    from serial.tools import list_ports  # noqa: PLC0415  slow, and only needed here

    code = getattr(problem, "errno", None)
    cure = {
        errno.ENOENT: "Check that it is plugged in.",
        errno.EACCES: "This user may not open it: add the user to the group that owns it (often `dialout`).",
        errno.EBUSY: "Another program has it open: close that program first.",
        errno.EAGAIN: "Another program has it open: close that program first.",
    }.get(code or 0, "")
    there = ", ".join(sorted(port.device for port in list_ports.comports())) or "none"
    why = os.strerror(code) if code else str(problem)
    return f"cannot open {path} at {baud} baud: {why}. {cure} Serial ports present: {there}."
