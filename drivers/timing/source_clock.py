"""A device's sample counter mapped to seconds of the host's clock, while a campaign plays.

A datagram is read some time after its sample was taken, never before. Per quarter of a second the
datagram that came through fastest says where the device's clock stands; a straight line through those
gives offset and drift. So one late read, or a thousand, do not move a sample in time.

This is the map that runs along: the guard and the live display need a time at once. What is kept is stamped anew
by a line that also knows what came afterwards (``drivers.timing.retiming``).
"""

from __future__ import annotations

import numpy as np

from drivers.timing.line_fit import lower_line

BLOCK_S = 0.25  # s
MAX_FIT_BLOCKS = 240  # a minute, over which a crystal runs straight
MIN_BLOCKS_FOR_DRIFT = 6  # 1.5 s


class SourceClock:
    """Fit of host time against device time, fed with one observation a datagram.

    Parameters
    ----------
    period_s
        Nominal time between two counts of the device.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._source_s = np.empty(MAX_FIT_BLOCKS)
        self._excess_s = np.empty(MAX_FIT_BLOCKS)  # host minus source time, relative to the first offset
        self._blocks = 0
        self._block_end_s: float | None = None
        self._best_s = np.inf
        self._best_at_s = 0.0
        self._origin_s = 0.0
        self._offset_s = 0.0
        self._base_s = 0.0
        self._drift = 0.0
        self.fits = 0
        """Counts the changes of the map: between two of them it is one straight line."""

    @property
    def drift(self) -> float:
        """How much slower the device's clock runs than the host's."""
        return self._drift

    @property
    def drift_ppm(self) -> float:
        """How much slower the device's clock runs than the host's, in millionths."""
        return self._drift * 1e6

    @property
    def started(self) -> bool:
        """True once anything was observed."""
        return self._block_end_s is not None

    @property
    def settled(self) -> bool:
        """True once offset and drift rest on enough data."""
        return self._blocks >= MIN_BLOCKS_FOR_DRIFT

    def observe(self, count: int, taken_at_s: float) -> None:
        """A sample of this (unwrapped) count was taken at the latest at ``taken_at_s`` of the host."""
        source_s = count * self.period_s
        if self._block_end_s is None:
            self._origin_s = source_s
            self._offset_s = self._base_s = taken_at_s - source_s
            self._block_end_s = source_s + BLOCK_S
        excess_s = taken_at_s - source_s - self._base_s - self._drift * (source_s - self._origin_s)
        if excess_s < self._best_s:
            self._best_s, self._best_at_s = excess_s, source_s
            if not self._blocks:
                self._offset_s = self._base_s + excess_s  # before the first block is full, follow at once
                self.fits += 1
        if source_s >= self._block_end_s:
            self._close_block(source_s)

    def _close_block(self, source_s: float) -> None:
        slot = self._blocks % MAX_FIT_BLOCKS
        self._source_s[slot] = self._best_at_s - self._origin_s
        self._excess_s[slot] = self._best_s + self._drift * (self._best_at_s - self._origin_s)
        self._blocks += 1
        self._block_end_s = source_s + BLOCK_S
        self._best_s = np.inf
        self._fit()

    def _fit(self) -> None:
        self.fits += 1
        n = min(self._blocks, MAX_FIT_BLOCKS)
        x, y = self._source_s[:n], self._excess_s[:n]
        if n < MIN_BLOCKS_FOR_DRIFT:
            self._offset_s = self._base_s + float(y.min())
            return
        self._drift, level = lower_line(x, y)
        self._offset_s = self._base_s + level

    def host_time_s(self, count: int) -> float:
        """Host time at which the sample of this count was taken."""
        source_s = count * self.period_s
        return self._offset_s + source_s + self._drift * (source_s - self._origin_s)
