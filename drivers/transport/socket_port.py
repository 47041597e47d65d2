"""A byte port on a local socket, for emulated devices: ``unix:/path``.

A pseudo terminal hands bytes on through a worker of the kernel that has ordinary priority; on a busy machine it comes
tens of milliseconds late, whatever priority both ends have. A socket wakes its reader directly.
"""

from __future__ import annotations

import select
import socket
import time

from drivers.transport.ports import BULK_BYTES, BytePort, SerialPort, gone, stalled, url_fault
from rig.errors import ConfigError, DeviceFault

SCHEME = "unix:"


class SocketPort:
    """Connects to whoever listens there.

    Raises
    ------
    DeviceFault
        If nobody does.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.connect(name.removeprefix(SCHEME))
        except OSError as problem:
            self._socket.close()
            raise DeviceFault(f"cannot open {name}: {problem.strerror}. Is the emulator running?") from None
        self._socket.setblocking(False)

    @property
    def name(self) -> str:
        """As it was asked for."""
        return self._name

    def fileno(self) -> int | None:
        """File descriptor to wait on."""
        return self._socket.fileno()

    def read(self) -> bytes:
        """Everything that has arrived; never waits."""
        try:
            data = self._socket.recv(BULK_BYTES)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise gone(self._name, problem.strerror) from None
        if not data:
            raise gone(self._name, "end of file")
        return data

    def write(self, data: bytes, timeout_s: float = 0.1) -> None:
        """Send all bytes within the time, else DeviceFault."""
        view, deadline = memoryview(data), 0.0
        while view:
            try:
                view = view[self._socket.send(view) :]
            except BlockingIOError:
                now = time.monotonic()
                deadline = deadline or now + timeout_s
                if now >= deadline:
                    raise stalled(self._name, len(view), timeout_s) from None
                select.select([], [self._socket], [], deadline - now)
            except OSError as problem:
                raise gone(self._name, problem.strerror) from None

    def wait_readable(self, timeout_s: float) -> bool:
        """Wait for bytes at most so long."""
        return bool(select.select([self._socket], [], [], max(timeout_s, 0.0))[0])

    def close(self) -> None:
        """Close; safe twice."""
        self._socket.close()


def open_port(path: str, baud: int) -> BytePort:
    """The port of that name: a serial one, or an emulator's socket.

    Raises
    ------
    ConfigError
        If it is a URL.
    DeviceFault
        If it cannot be opened.
    """
    fault = url_fault(path)
    if fault is not None:
        raise ConfigError(f"port {fault}")
    return SocketPort(path) if path.startswith(SCHEME) else SerialPort(path, baud)
