"""The bench's clock: absolute deadlines, and an ear on a CAN bus that has none of its own while it waits.

What arrives is stamped when it arrives, not when the next tick looks for it. Otherwise the beat between a
device's clock and the ticks moves every time stamp by up to a tick. Serial ports are listened to by a thread
(``drivers.transport.listening``), and then nothing but sleep happens here.
"""

from __future__ import annotations

import time
from collections.abc import Callable

STOP_LISTENING_S = 80e-6  # before the deadline: serving a datagram takes about 20 us


class BenchClock:
    """The host's monotonic clock for a sequencer.

    Parameters
    ----------
    listen
        Waits at most so many seconds for a frame and takes it in; False at once where there is nothing to wait for.
    spin_s
        Looked at the clock instead of asleep for so long before each deadline.
    on_reading
        Told every reading that is handed out, for the capture.
    time_s
        Where seconds come from.
    """

    def __init__(
        self,
        listen: Callable[[float], bool],
        spin_s: float = 0.0,
        on_reading: Callable[[float], None] | None = None,
        time_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._listen = listen
        self._spin_s = spin_s
        self._on_reading = on_reading
        self._time = time_s

    def now_s(self) -> float:
        """Seconds of the host."""
        return self._recorded(self._time())

    def _recorded(self, time_s: float) -> float:
        if self._on_reading is not None:
            self._on_reading(time_s)
        return time_s

    def wait_until(self, deadline_s: float) -> float:
        """Listen, sleep, then spin, until the deadline."""
        listen_until_s = deadline_s - max(STOP_LISTENING_S, self._spin_s)
        while (left_s := listen_until_s - self._time()) > 0.0 and self._listen(left_s):
            continue
        asleep_s = deadline_s - self._spin_s - self._time()
        if asleep_s > 0.0:
            time.sleep(asleep_s)
        now_s = self._time()
        while now_s < deadline_s:
            now_s = self._time()
        return self._recorded(now_s)
