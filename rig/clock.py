"""Time, handed in: a real clock for the bench, one that jumps for simulations and tests."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable


class Clock(Protocol):
    """Seconds that never run backwards; the zero means nothing."""

    def now_s(self) -> float:
        """The present instant in seconds."""
        ...

    def wait_until(self, deadline_s: float) -> float:
        """Wait for an absolute instant and return the present one, at or after it.

        A deadline that has passed returns at once: lateness is the caller's to count.
        """
        ...


class HostClock(Clock, Protocol):
    """The clock of the computer that a bench hangs on: its bytes are stamped by it, its time-outs pass on it."""

    def pause(self, duration_s: float) -> None:
        """Let so much time pass."""
        ...


class SteppedLine(Protocol):
    """A port whose bytes are stamped by a clock in step."""

    @property
    def name(self) -> str:
        """Name of the port."""
        ...

    @property
    def written_bytes(self) -> int:
        """Bytes that were written to it since it was opened."""
        ...

    def stamp(self, arrivals: Sequence[tuple[float, int]], vanished: bool, patience_s: float) -> None:
        """Wait, at most so long of the computer's time, for bytes that were sent, and stamp them.

        ``arrivals`` are instants, each with the number of bytes sent until then since the port was opened;
        ``vanished`` says that the other end is gone behind them. Raises DeviceFault where they do not come.
        """
        ...


@runtime_checkable
class SteppedClock(HostClock, Protocol):
    """Time that passes only while it is waited for, and in which whatever is at the other end of the lines passes it
    too. What these send is stamped with the instant at which they sent it, however late the computer hands it on."""

    def join(self, line: SteppedLine) -> None:
        """From here on the bytes of this line are stamped; it has just been opened."""
        ...


class MonotonicClock:
    """The host's monotonic clock with absolute deadlines.

    Parameters
    ----------
    spin_s
        The last stretch before a deadline is spent looking at the clock instead of asleep. It buys
        precision with processor time; 0 leaves everything to the operating system.
    """

    def __init__(self, spin_s: float = 0.0) -> None:
        self._spin_s = spin_s

    def now_s(self) -> float:
        """Seconds on ``time.monotonic``."""
        return time.monotonic()

    def wait_until(self, deadline_s: float) -> float:
        """Sleep, then spin, until the deadline."""
        now = time.monotonic()
        asleep = deadline_s - self._spin_s - now
        if asleep > 0.0:
            # An absolute wait on clock_nanosleep inside CPython 3.11+, so early wake-ups do not add up.
            time.sleep(asleep)
            now = time.monotonic()
        while now < deadline_s:
            now = time.monotonic()
        return now

    def pause(self, duration_s: float) -> None:
        """Sleep."""
        time.sleep(duration_s)


class VirtualClock:
    """Time that passes only when somebody waits for it, and then at once.

    Parameters
    ----------
    late_s
        How late to wake after a deadline, as a function of the deadline: for tests of lateness.
    """

    def __init__(self, start_s: float = 0.0, late_s: Callable[[float], float] | None = None) -> None:
        self._now_s = start_s
        self._late_s = late_s

    def now_s(self) -> float:
        """The instant that was last waited for."""
        return self._now_s

    def wait_until(self, deadline_s: float) -> float:
        """Jump to the deadline."""
        if self._late_s is not None:
            deadline_s += self._late_s(deadline_s)
        self._now_s = max(self._now_s, deadline_s)
        return self._now_s
