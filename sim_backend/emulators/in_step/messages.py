"""What the bench and the emulators in step with it say to each other: one JSON line each way for every step of time.

Bytes are counted from the opening of a port on, and openings from the start, so that neither takes what an earlier
opening still had under way for its own.
"""

from __future__ import annotations

import json
import socket
from typing import NamedTuple

from rig.errors import DeviceFault

START_S = 1000.0  # s, where time begins: elsewhere 0 stands for "never"
LONGEST_STEP_S = 0.01  # s of emulated time: 20 datagrams of 2 kHz, far below what the buffer of a socket holds
PATIENCE_S = 20.0  # s of the computer: a step takes milliseconds, and no machine that is used at all stalls for so long
ONE_READ = 65_536  # bytes


class Written(NamedTuple):
    """What the bench has written to a port since it opened it, for the ``opening``-th time."""

    opening: int
    written_bytes: int


class Request(NamedTuple):
    """Let time pass until then, once what was written to the ports (by name) has been taken in."""

    number: int
    until_s: float
    written: dict[str, Written]


class Sent(NamedTuple):
    """What a port has sent since this opening: instants, and the bytes until then; and whether it is still there."""

    opening: int
    plugged_in: bool
    arrivals: list[tuple[float, int]]


class Reply(NamedTuple):
    """The instant that was reached, and what the ports (by name) have sent on the way."""

    number: int
    now_s: float
    sent: dict[str, Sent]


class Channel:
    """One end of the connection between both."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._rest = b""

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def send(self, message: Request | Reply) -> None:
        """Hand a message over. Raises OSError where the other end is gone."""
        self._socket.sendall(json.dumps(message, separators=(",", ":")).encode() + b"\n")

    def _line(self, patience_s: float) -> bytes:
        """The next line; b"" at the end. Raises TimeoutError."""
        self._socket.settimeout(patience_s)
        while b"\n" not in self._rest:
            try:
                data = self._socket.recv(ONE_READ)
            except ConnectionError:  # it ended with something unread
                return b""
            if not data:
                return b""
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\n")
        return line

    def request(self, patience_s: float) -> Request | None:
        """The next request; None once the bench is gone. Raises TimeoutError."""
        line = self._line(patience_s)
        if not line:
            return None
        number, until_s, written = json.loads(line)
        return Request(number, until_s, {name: Written(*item) for name, item in written.items()})

    def reply(self, patience_s: float) -> Reply:
        """The next reply. Raises DeviceFault if there is none within the time, or never will be."""
        try:
            line = self._line(patience_s)
        except TimeoutError:
            raise DeviceFault(f"the emulated devices, in step, have not answered for {patience_s:g} s") from None
        if not line:
            raise DeviceFault("the emulated devices, in step, have ended, and time with them")
        number, now_s, sent = json.loads(line)
        return Reply(number, now_s, {name: Sent(*item) for name, item in sent.items()})

    def close(self) -> None:
        """Let go of it; safe twice."""
        self._socket.close()
