"""Rows of a recording laid on an even beat, block by block."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.arrays import Array

MAX_OFF_BEAT_PERIODS = 0.3  # of a period: stamps that lie farther from the beat belong to none
LONGEST_HOLE_S = 1.0  # a longer one ends a span


class Uneven(Exception):
    """The time stamps have no beat, or a hole in them is too long to be bridged."""


class Laying:
    """Lays one block after another; ``step_s`` is the beat that is expected, as the median spacing tells it.

    Blocks hold "time" and "valid" and other columns by name. What is missing or not valid is bridged by straight lines
    and marked in "bad".
    """

    def __init__(self, step_s: float) -> None:
        self.step_s = step_s
        self._last: dict[str, float] = {}
        self.first_s: float | None = None
        self.count = 0  # instants laid

    @property
    def last_s(self) -> float:
        """Time stamp of the last row."""
        return self._last["time"]

    def lay(self, block: Mapping[str, Array]) -> dict[str, Array]:
        """The next instants: every column but the time, and "bad", each of shape (n,). Raises Uneven."""
        time = block["time"]
        if self.first_s is None:
            self.first_s = float(time[0])
            before = float(time[0]) - self.step_s
        else:
            before = self.last_s
        spacing = np.diff(time, prepend=before) / self.step_s
        steps = np.rint(spacing)
        longest = max(2.0, LONGEST_HOLE_S / self.step_s)
        if np.any(np.abs(spacing - steps) > MAX_OFF_BEAT_PERIODS) or np.any(steps < 1.0) or np.any(steps > longest):
            raise Uneven
        at = np.cumsum(steps).astype(np.int64)  # 1 is the instant after the last one laid
        n = int(at[-1])
        grid, bad = np.arange(1, n + 1), np.ones(n, dtype=bool)
        good = block["valid"].astype(bool)
        bad[at[good] - 1] = False
        out: dict[str, Array] = {"bad": bad.astype(float)}
        for name, values in block.items():
            if name in ("time", "valid"):
                continue
            further = name.startswith("channel ")
            there = good & np.isfinite(values)
            if further:  # its readings may be rarer: nothing is bridged
                out[name] = np.full(n, np.nan)
                out[name][at[there] - 1] = values[there]
                continue
            x, y = at[there].astype(float), values[there]
            if name in self._last:
                x, y = np.concatenate([[0.0], x]), np.concatenate([[self._last[name]], y])
            out[name] = values[:0] if not n else np.interp(grid, x, y) if len(x) else np.zeros(n)
            self._last[name] = float(out[name][-1])
        self._last["time"] = float(time[-1])
        self.count += n
        return out


class Decimating:
    """Low-passes columns and keeps every ``factor``-th instant, block by block; ``weights`` by column, odd in length.

    Instants are kept from REACH new samples behind the first, where the filter lies within what was laid.
    """

    def __init__(self, factor: int, weights: Mapping[str, Array]) -> None:
        self.factor = factor
        longest = max(len(w) for w in weights.values()) // 2
        self.reach = -(-longest // factor) * factor  # a whole number of new samples
        self._weights = {
            name: np.pad(w, self.reach - len(w) // 2)[::-1] for name, w in weights.items()
        }  # reversed: upfirdn convolves
        self._kept: dict[str, Array] = {}

    def pass_on(self, laid: Mapping[str, Array]) -> dict[str, Array]:
        """The next new samples of every column with weights."""
        from scipy.signal import upfirdn  # noqa: PLC0415  slow to import

        out = {}
        for name, weights in self._weights.items():
            values = np.concatenate([self._kept[name], laid[name]]) if name in self._kept else laid[name]
            lead = 2 * self.reach // self.factor
            n = max(0, (len(values) - 1) // self.factor - lead + 1)
            out[name] = upfirdn(weights, values, 1, self.factor)[lead : lead + n] if n else values[:0]
            self._kept[name] = values[n * self.factor :].copy()
        return out
