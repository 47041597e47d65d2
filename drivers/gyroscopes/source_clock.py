"""Time at the source: a device's sample counter turned into seconds of the host's clock.

A datagram is read some time after its sample was taken, never before. Per quarter of a second the
datagram that came through fastest says where the device's clock stands; a straight line through those
gives offset and drift. So one late read, or a thousand, do not move a sample in time.
"""

from __future__ import annotations

from collections import deque

BLOCK_S = 0.25
BLOCKS_KEPT = 240
DRIFT_LIMIT = 1e-3
MIN_BLOCKS_FOR_DRIFT = 4


class SourceClock:
    """Fit of host time against device time, fed with one observation a datagram.

    Parameters
    ----------
    period_s
        Nominal time between two counts of the device.
    """

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self._blocks: deque[tuple[float, float]] = deque(maxlen=BLOCKS_KEPT)
        self._block_end_s: float | None = None
        self._best: tuple[float, float] | None = None
        self._origin_s = 0.0
        self._offset_s = 0.0
        self._drift = 0.0

    @property
    def drift_ppm(self) -> float:
        """How much slower the device's clock runs than the host's, in millionths."""
        return self._drift * 1e6

    @property
    def settled(self) -> bool:
        """True once offset and drift rest on a second of data."""
        return len(self._blocks) >= MIN_BLOCKS_FOR_DRIFT

    def observe(self, count: int, taken_at_s: float) -> None:
        """A sample of this (unwrapped) count was taken at the latest at ``taken_at_s`` of the host."""
        source_s = count * self.period_s
        if self._block_end_s is None:
            self._origin_s = source_s
            self._offset_s = taken_at_s - source_s
            self._block_end_s = source_s + BLOCK_S
        excess = taken_at_s - self.host_time_s(count)
        if self._best is None or excess < self._best[0]:
            self._best = (excess, source_s)
            if not self._blocks and excess < 0.0:
                self._offset_s += excess  # before the first block is full, follow at once
                self._best = (0.0, source_s)
        if source_s >= self._block_end_s:
            self._close_block(source_s)

    def _close_block(self, source_s: float) -> None:
        assert self._best is not None
        excess, at_s = self._best
        host_s = self._offset_s + at_s + self._drift * (at_s - self._origin_s) + excess
        self._blocks.append((at_s, host_s - at_s))
        self._block_end_s = source_s + BLOCK_S
        self._best = None
        self._fit()

    def _fit(self) -> None:
        n = len(self._blocks)
        mean_x = sum(x for x, _ in self._blocks) / n
        mean_y = sum(y for _, y in self._blocks) / n
        if n >= MIN_BLOCKS_FOR_DRIFT:
            sxx = sum((x - mean_x) ** 2 for x, _ in self._blocks)
            sxy = sum((x - mean_x) * (y - mean_y) for x, y in self._blocks)
            self._drift = max(-DRIFT_LIMIT, min(DRIFT_LIMIT, sxy / sxx))
        self._offset_s = mean_y - self._drift * (mean_x - self._origin_s)

    def host_time_s(self, count: int) -> float:
        """Host time at which the sample of this count was taken."""
        source_s = count * self.period_s
        return self._offset_s + source_s + self._drift * (source_s - self._origin_s)
