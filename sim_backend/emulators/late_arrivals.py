"""Frames that arrived while the machine paused the emulators, moved back to the time they were sent.

A drive does not stop because a computer is busy; a process that emulates one does. Were the frames that waited
meanwhile all taken at the moment of waking up, the shaft would stand under an old torque and then get many new
ones at once: a step that no host sent, and that a lightly damped platform answers with a ring of twice its height.
"""

from __future__ import annotations

from typing import NamedTuple

LATE_LOOK_S = 0.0015  # between two looks at the ports; more than this is the machine's doing
REPORTED_PAUSE_S = 0.005  # a longer pause is told, since it bears on every time measured around it
SMOOTHING = 0.2  # weight of the newest interval between lines: five lines of memory


class ReceivedBytes(NamedTuple):
    """Bytes of the host, ended by a carriage return but for the last, and when they are taken to have come."""

    time_s: float
    data: bytes


class ArrivalTimes:
    """Knows how often a line usually comes, and so when those that waited were sent."""

    def __init__(self) -> None:
        self._line_every_s = 0.0
        self._last_s: float | None = None

    def pieces(self, data: bytes, before_s: float, now_s: float) -> list[ReceivedBytes]:
        """``data``, found at ``now_s``; the port was looked at last at ``before_s``.

        Found in time it is one piece. Else its lines came as often as they usually do, the last one just now, the
        first one after ``before_s``: one lone line, be it "torque off", is never put back.
        """
        lines = data.count(b"\r")
        last_s, self._last_s = self._last_s, now_s
        if now_s - before_s <= LATE_LOOK_S or lines < 2 or not self._line_every_s:
            if last_s is not None and lines:
                every_s = (now_s - last_s) / lines
                self._line_every_s += (SMOOTHING if self._line_every_s else 1.0) * (every_s - self._line_every_s)
            return [ReceivedBytes(now_s, data)]
        every_s = min(self._line_every_s, (now_s - before_s) / lines)
        parts = data.split(b"\r")
        ended = [part + b"\r" for part in parts[:-1]]
        found = [ReceivedBytes(now_s - (lines - 1 - k) * every_s, line) for k, line in enumerate(ended)]
        return [*found, ReceivedBytes(now_s, parts[-1])] if parts[-1] else found
