"""A Lawicel CAN adapter: the line protocol between its serial side and its bus."""

from __future__ import annotations

import time
from collections.abc import Callable

from drivers.codecs import lawicel
from drivers.codecs.lawicel import CanFrame

_MAX_COMMAND_BYTES = 64
_FRAME_HEADS = b"tTrR"
VERSION, SERIAL = "V1013", "NE402"


class LawicelAdapter:
    """Feeds frames to ``on_frame`` and turns frames from the bus into bytes for the host.

    It answers as the CANUSB does: CR for done, BEL for refused, z/Z for a frame that was sent.

    Parameters
    ----------
    on_frame
        Called with every frame that the host sends on an open channel.
    clock
        Seconds, for time stamps.
    """

    def __init__(self, on_frame: Callable[[CanFrame], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._on_frame = on_frame
        self._clock = clock
        self._rest = b""
        self.is_open = False
        self.listen_only = False
        self.bit_rate_code = ""
        self.timestamps = False
        self.flags = 0

    def feed(self, data: bytes) -> bytes:
        """Bytes from the host; returns the adapter's answers."""
        *lines, self._rest = (self._rest + data).split(b"\r")
        if len(self._rest) > _MAX_COMMAND_BYTES:
            self._rest = b""
        return b"".join(self._answer(line) for line in lines)

    def to_host(self, frame: CanFrame) -> bytes:
        """A frame from the bus as the host gets it; nothing while the channel is closed."""
        if not self.is_open:
            return b""
        stamp = int(self._clock() * 1e3) % lawicel.TIMESTAMP_MODULO_MS if self.timestamps else -1
        return lawicel.encode_frame(frame._replace(timestamp_ms=stamp))

    def _answer(self, line: bytes) -> bytes:
        if not line:
            return lawicel.ANSWER_OK
        if line[:1] in (b"t", b"T", b"r", b"R"):
            return self._send(line)
        text = line.decode("ascii", errors="replace")
        return self._command(text)

    def _send(self, line: bytes) -> bytes:
        frame = lawicel.decode_line(line)
        if not isinstance(frame, CanFrame) or not self.is_open or self.listen_only:
            return lawicel.ANSWER_ERROR
        self._on_frame(frame)
        return b"Z\r" if frame.extended else b"z\r"

    def _command(self, text: str) -> bytes:
        known = {"V": VERSION, "N": SERIAL}
        if text in known:
            return known[text].encode("ascii") + lawicel.ANSWER_OK
        if text == "F" and self.is_open:
            return b"F%02X\r" % self.flags
        return lawicel.ANSWER_OK if self._change(text) else lawicel.ANSWER_ERROR

    def _change(self, text: str) -> bool:
        """Carry out a command that changes the adapter; False where it is refused."""
        if text in ("O", "L"):
            done = not self.is_open and bool(self.bit_rate_code)
            if done:
                self.is_open, self.listen_only = True, text == "L"
            return done
        if text == "C":
            was_open, self.is_open = self.is_open, False
            return was_open
        if self.is_open:
            return False  # everything below is only allowed on a closed channel
        if text in lawicel.BIT_RATE_CODES.values():
            self.bit_rate_code = text
            return True
        if text in ("Z0", "Z1"):
            self.timestamps = text == "Z1"
            return True
        return False
