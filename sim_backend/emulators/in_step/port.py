"""The emulators' end of a port in step: it knows when it sent what, and hands it over at the end of a step."""

from __future__ import annotations

from collections.abc import Callable

from sim_backend.emulators.in_step.messages import Sent
from sim_backend.emulators.socket_port import SocketListener


class SteppedSocket(SocketListener):
    """A local socket. What is written within a step goes out in one go: its reader is woken once.

    Parameters
    ----------
    clock
        Seconds of the emulated bench.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self.openings = self.received_bytes = 0  # the latter since the last of the former
        self._begin()

    def _begin(self) -> None:
        self._waiting = b""
        self._sent_bytes = 0
        self._arrivals: list[tuple[float, int]] = []

    def read(self) -> bytes:
        """What the other end has written, b"" if nothing."""
        before = self._peer
        data = super().read()
        if self._peer is not None and self._peer is not before:
            self.openings, self.received_bytes = self.openings + 1, 0
            self._begin()
        self.received_bytes += len(data)
        return data

    def write(self, data: bytes) -> None:
        """Send when the step is over; what nobody listens to is lost."""
        if self._peer is None:
            self.lost_bytes += len(data)
            return
        self._waiting += data
        self._sent_bytes += len(data)
        self._arrivals.append((self._clock(), self._sent_bytes))

    def _pass_on(self) -> None:
        waiting, self._waiting = self._waiting, b""
        if waiting:
            super().write(waiting)

    def hand_over(self) -> Sent:
        """Let the other end have what was sent in this step, and say when it was sent."""
        self._pass_on()
        arrivals, self._arrivals = self._arrivals, []
        return Sent(self.openings, self.plugged_in, arrivals)

    def close(self) -> None:
        """Unplug: the other end sees a hang-up behind what was sent before; safe twice."""
        if self.plugged_in:
            self._pass_on()
        super().close()
