"""The last seconds of a channel as lowest and highest value of short bins: what a strip chart draws."""

from __future__ import annotations

import math

from rig.arrays import Array

BIN_S = 0.02  # a 9 Hz tone still has five bins a period
SHOWN_S = 6.0


class Envelope:
    """Lowest and highest value in every bin of the last seconds."""

    def __init__(self) -> None:
        self._bins: dict[int, tuple[float, float]] = {}
        self._last = 0

    def add(self, time_s: Array, values: Array) -> None:
        """Further samples, shape (n,) each; what is not a number is left out."""
        for t, value in zip(time_s.tolist(), values.tolist(), strict=True):
            if not (math.isfinite(t) and math.isfinite(value)):
                continue
            at = int(t / BIN_S)
            low, high = self._bins.get(at, (value, value))
            self._bins[at] = (min(low, value), max(high, value))
            self._last = max(self._last, at)
        first = self._last - int(SHOWN_S / BIN_S)
        for at in [k for k in self._bins if k < first]:
            del self._bins[at]

    def points(self) -> list[tuple[float, float, float]]:
        """(time in s, lowest, highest), in order of time, five digits each."""
        return [
            (round((k + 0.5) * BIN_S, 3), float(f"{low:.5g}"), float(f"{high:.5g}"))
            for k, (low, high) in sorted(self._bins.items())
        ]
