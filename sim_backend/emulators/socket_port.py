"""The emulators' end of a port on a local socket; see ``drivers.transport.socket_port`` for why there are such."""

from __future__ import annotations

import contextlib
import shutil
import socket
import tempfile
from pathlib import Path


class SocketListener:
    """A port that one driver at a time may open. Bytes that nobody reads are dropped, and counted."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="rig-"))
        place = self._folder / "port"
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(str(place))
        self._listener.listen(1)
        self._listener.setblocking(False)
        self._peer: socket.socket | None = None
        self.path = f"unix:{place}"
        self.lost_bytes = 0
        self.plugged_in = True

    def fileno(self) -> int:
        """Descriptor to wait on: the driver's, or that of the next one to come."""
        return (self._peer or self._listener).fileno()

    def read(self) -> bytes:
        """What the other end has written, b"" if nothing."""
        if self._peer is None:
            with contextlib.suppress(OSError):
                self._peer, _ = self._listener.accept()
                self._peer.setblocking(False)
            return b""
        try:
            data = self._peer.recv(65_536)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._hang_up()
        return data

    def write(self, data: bytes) -> None:
        """Send; what does not fit, or nobody listens to, is lost."""
        sent = 0
        if self._peer is not None:
            try:
                sent = self._peer.send(data, socket.MSG_NOSIGNAL)
            except BlockingIOError:
                sent = 0
            except OSError:
                self._hang_up()
        self.lost_bytes += len(data) - sent

    def _hang_up(self) -> None:
        if self._peer is not None:
            self._peer.close()
            self._peer = None

    def close(self) -> None:
        """Unplug: the other end sees a hang-up; safe twice."""
        if not self.plugged_in:
            return
        self.plugged_in = False
        self._hang_up()
        self._listener.close()
        shutil.rmtree(self._folder, ignore_errors=True)
