"""The bench's clock: absolute deadlines, and an ear on a CAN bus that has none of its own while it waits.

What arrives is stamped when it arrives, not when the next tick looks for it. Otherwise the beat between a
device's clock and the ticks moves every time stamp by up to a tick. Serial ports are listened to by a thread
(``drivers.transport.listening``), and then nothing but waiting happens here.
"""

from __future__ import annotations

from collections.abc import Callable

from rig.clock import HostClock

STOP_LISTENING_S = 80e-6  # before the deadline: serving a datagram takes about 20 us


class BenchClock:
    """The host's clock for a sequencer.

    Parameters
    ----------
    listen
        Waits at most so many seconds for a frame and takes it in; False at once where there is nothing to wait for.
    clock
        Where seconds come from.
    spin_s
        How long before each deadline ``clock`` is looked at instead of slept on: nothing is listened to then.
    on_reading
        Told every reading that is handed out, for the capture.
    """

    def __init__(
        self,
        listen: Callable[[float], bool],
        clock: HostClock,
        spin_s: float = 0.0,
        on_reading: Callable[[float], None] | None = None,
    ) -> None:
        self._listen, self._clock = listen, clock
        self._spin_s = spin_s
        self._on_reading = on_reading

    def now_s(self) -> float:
        """Seconds of the host."""
        return self._recorded(self._clock.now_s())

    def _recorded(self, time_s: float) -> float:
        if self._on_reading is not None:
            self._on_reading(time_s)
        return time_s

    def wait_until(self, deadline_s: float) -> float:
        """Listen, then wait, until the deadline."""
        listen_until_s = deadline_s - max(STOP_LISTENING_S, self._spin_s)
        while (left_s := listen_until_s - self._clock.now_s()) > 0.0 and self._listen(left_s):
            continue
        return self._recorded(self._clock.wait_until(deadline_s))
