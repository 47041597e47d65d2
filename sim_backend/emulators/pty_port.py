"""A pseudo terminal that stands for a serial port: the emulator holds one end, the driver opens the other."""

from __future__ import annotations

import os


class PtyPort:
    """Raw, non-blocking, bulk. Bytes that nobody reads are dropped as a UART drops them, and counted.

    Raises
    ------
    OSError
        Where the system has no pseudo terminals (Windows).
    """

    def __init__(self) -> None:
        import pty  # noqa: PLC0415  POSIX only
        import tty  # noqa: PLC0415

        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)  # the held slave end keeps the port alive while no driver has it open
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self.lost_bytes = 0
        self.plugged_in = True

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._master

    def read(self) -> bytes:
        """What the other end has written, b"" if nothing."""
        try:
            return os.read(self._master, 65_536)
        except (BlockingIOError, OSError):
            return b""

    def write(self, data: bytes) -> None:
        """Send; what does not fit is lost."""
        if not self.plugged_in:
            return
        try:
            sent = os.write(self._master, data)
        except BlockingIOError:
            sent = 0
        self.lost_bytes += len(data) - sent

    def close(self) -> None:
        """Unplug: the other end sees a hang-up; safe twice."""
        if not self.plugged_in:
            return
        self.plugged_in = False
        for descriptor in (self._master, self._slave):
            try:
                os.close(descriptor)
            except OSError:
                continue  # closed before
