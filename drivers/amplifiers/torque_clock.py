"""Time of the torque that a drive reports: the drive's time stamps on the host's clock.

What comes back is heard late, so the fastest answers alone put every stamp late by the shortest way back. The
shortest way there and back is known, how it divides is not: all of it is taken off, so that a torque is never
stamped later than it acted. A gyro's samples are never stamped early. What is left between the two is a delay
and not its opposite, which no model of a drive could describe.
"""

from __future__ import annotations

import math
import statistics
from collections import deque

from drivers.timing.retiming import OWN_LINE, ClockRetiming
from drivers.timing.source_clock import BLOCK_S, SourceClock

MAX_ANSWER_BLOCKS = 240  # a minute
MAX_UNANSWERED = 16  # requests that wait for an answer
FAST_SHARE = 0.1  # of the answers of a block; the fastest one may be a slip


class TorqueClock:
    """Fed with every request and every stamped answer.

    Parameters
    ----------
    unit_s
        Time of one count of the drive's clock.
    modulus
        Its counter wraps here.
    """

    def __init__(self, unit_s: float, modulus: int) -> None:
        self._back = SourceClock(unit_s)
        self.retiming = ClockRetiming(self._back)
        self._unit_s, self._modulus = unit_s, modulus
        self._stamp: int | None = None
        self._asked_s: deque[float] = deque(maxlen=MAX_UNANSWERED)
        self._ways_s: list[float] = []
        self._blocks_s: deque[float] = deque(maxlen=MAX_ANSWER_BLOCKS)
        self._block_end_s = 0.0
        self._last_s = -math.inf
        self.way_s = 0.0
        self._ways_known = 0

    def asked(self, at_s: float) -> None:
        """A request to apply and stamp was handed over."""
        self._asked_s.append(at_s)

    def received(self, stamp: int, heard_s: float) -> float:
        """Host time of a stamp that was heard at ``heard_s``; later than every one before."""
        before = self._stamp if self._stamp is not None else stamp
        self._stamp = before + (stamp - before) % self._modulus
        self._back.observe(self._stamp, heard_s)
        stamped_s = self._back.host_time_s(self._stamp)
        # An answer may be looked at after the next request has gone out; what it answers went before it came.
        before_it = []
        while self._asked_s and self._asked_s[0] <= heard_s:
            before_it.append(self._asked_s.popleft())
        if len(before_it) == 1:  # two at once cannot be told apart
            self._note_way(stamped_s - before_it[0], heard_s)
        source_s = self._stamp * self._unit_s
        self.retiming.observe(source_s, heard_s, before_it[0] if len(before_it) == 1 else math.nan)
        line = self._back.fits + self._ways_known
        # Set points that the drive took up together carry one stamp; the last of them is the one that holds.
        time_s = stamped_s - self.way_s
        if time_s < self._last_s + self._unit_s:
            time_s, line = self._last_s + self._unit_s, OWN_LINE
        self._last_s = time_s
        self.retiming.record(time_s, source_s, line)
        return time_s

    def _note_way(self, way_s: float, now_s: float) -> None:
        """Of each block a fast way, not the fastest; of the blocks the median: neither a stall nor a slip moves it."""
        self._ways_s.append(way_s)
        if now_s < self._block_end_s:
            return
        if self._block_end_s:
            self._ways_s.sort()
            self._blocks_s.append(self._ways_s[int(FAST_SHARE * (len(self._ways_s) - 1))])
            self.way_s = max(0.0, statistics.median(self._blocks_s))
            self._ways_known += 1
        self._block_end_s = now_s + BLOCK_S
        self._ways_s.clear()
