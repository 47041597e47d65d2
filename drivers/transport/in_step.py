"""A port whose bytes are stamped by a clock in step: with the instant at which they were sent, not at which they came.

The listening thread reads as on any port. But when a byte got through to it says how busy this computer is; so it only
keeps what it reads, and the clock, which is told how many bytes were sent until when, has it stamped before time goes
on.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

from drivers.transport.listening import ListeningPort
from drivers.transport.ports import BytePort
from rig.clock import HostClock, SteppedClock
from rig.errors import DeviceFault

POLL_INTERVAL_S = 0.0005  # while bytes are waited for: half a tick of 1 kHz


class InStepPort(ListeningPort):
    """Wraps a port, as its base does.

    Parameters
    ----------
    port
        A port that has just been opened, left to this one from here on.
    clock
        Stamps what arrives; joined here.
    """

    def __init__(self, port: BytePort, clock: SteppedClock) -> None:
        self._steps = clock
        self._unstamped = bytearray()
        self._read_bytes = self._stamped_bytes = 0
        self.written_bytes = 0
        self._news = threading.Condition()
        super().__init__(port, clock.now_s)
        clock.join(self)

    def _take_in(self, data: bytes) -> None:
        with self._news:
            self._unstamped += data
            self._read_bytes += len(data)

    def _wake(self) -> None:
        super()._wake()
        with self._news:
            self._news.notify_all()

    def stamp(self, arrivals: Sequence[tuple[float, int]], vanished: bool, patience_s: float) -> None:
        """As ``rig.clock.SteppedLine`` has it."""
        sent_bytes = arrivals[-1][1] if arrivals else 0
        with self._news:
            came = self._news.wait_for(lambda: self._has_read(sent_bytes, vanished), patience_s)
            for time_s, until in arrivals:
                data = bytes(self._unstamped[: until - self._stamped_bytes])
                del self._unstamped[: len(data)]
                self._stamped_bytes += len(data)
                if data:
                    self._chunks.append((time_s, data))
            missing = sent_bytes - self._read_bytes
        if not came:
            raise DeviceFault(f"{self.name}: {missing} bytes that were sent have not arrived within {patience_s:g} s")

    def _has_read(self, sent_bytes: int, vanished: bool) -> bool:
        ended = self._fault is not None or self._closing
        return ended or (self._read_bytes >= sent_bytes and not vanished)

    def write(self, data: bytes, timeout_s: float = 0.1) -> None:
        """Send all bytes within the time, else DeviceFault. It is the computer's time: no other passes meanwhile."""
        super().write(data, timeout_s)
        self.written_bytes += len(data)

    def wait_readable(self, timeout_s: float) -> bool:
        """Let time pass until there are bytes, at most so much."""
        clock, until_s = self._steps, self._steps.now_s() + timeout_s
        while not self._chunks and self._fault is None and (now_s := clock.now_s()) < until_s:
            clock.wait_until(min(until_s, now_s + POLL_INTERVAL_S))
        return bool(self._chunks) or self._fault is not None


def listening(port: BytePort, clock: HostClock) -> ListeningPort:
    """A port with a thread that listens to it, stamped as the clock asks for."""
    return InStepPort(port, clock) if isinstance(clock, SteppedClock) else ListeningPort(port, clock.now_s)
