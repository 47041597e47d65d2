"""Lateness of the ticks of a set, counted in classes, so that memory stays bounded."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable

CLASS_RATIO = 1.01  # of the ends of a class: quantiles are right to within a per cent
MIN_CLASS_S, MAX_CLASS_S = 1e-7, 1e4  # range of the classes, s: the clock's resolution to some hours
_PER_LOG = 1.0 / math.log(CLASS_RATIO)
_CLASSES = int(math.log(MAX_CLASS_S / MIN_CLASS_S) * _PER_LOG) + 2


class Lateness:
    """Counts of ticks by how late they were played; the largest is kept as it was.

    Parameters
    ----------
    late_s
        To begin with, in s.
    """

    def __init__(self, late_s: Iterable[float] = ()) -> None:
        self._counts = array("q", bytes(8 * _CLASSES))
        self.ticks = 0
        self.max_s = 0.0
        for one in late_s:
            self.add(one)

    def add(self, late_s: float) -> None:
        """One more tick."""
        self.ticks += 1
        self.max_s = max(self.max_s, late_s)
        if late_s > MIN_CLASS_S:
            self._counts[min(1 + int(math.log(late_s / MIN_CLASS_S) * _PER_LOG), _CLASSES - 1)] += 1
        else:
            self._counts[0] += 1

    def quantile_s(self, share: float) -> float:
        """The lateness that this share of the ticks did not exceed, in s: at most a per cent too long, never longer
        than the longest; NaN without a tick."""
        if not self.ticks:
            return math.nan
        wanted, passed = share * self.ticks, 0
        for number, count in enumerate(self._counts):
            passed += count
            if passed >= wanted and passed:
                return min(MIN_CLASS_S * CLASS_RATIO**number, self.max_s) if number < _CLASSES - 1 else self.max_s
        return self.max_s
