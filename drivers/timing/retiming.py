"""Time stamps corrected after the campaign, by a line that is also fitted to later readings.

While a campaign plays, a device's clock is mapped to the host's by a fit that learns and therefore moves, by tens of
microseconds in the first minute and whenever the ways get slower or faster. The clocks themselves are straight
lines over a minute. So of every quarter of a second the fast readings are kept, and of every set the points between
which the running map was one line; when nothing is played any more, a straight line through the readings of the
minute before, the set itself and the minute after gives the times that stand in the recording.

An answer bounds an instant from above; where the request is known too, it bounds it from below. Between the two a
machine that becomes slower moves nothing, because it becomes slower on both ways.
"""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field

import numpy as np

from drivers.timing.line_fit import lower_line, middle_line
from drivers.timing.source_clock import BLOCK_S, SourceClock
from rig.arrays import Array

MARGIN_BESIDE_SET_S = 60.0  # on either side of a set
LONGEST_LINE_S = 60.0  # longer sets get a line a minute, joined: no crystal runs straight for ever
MAX_STORED_BLOCKS = int(24 * 3600 / BLOCK_S)
MIN_LINE_BLOCKS = 12  # blocks: 3 s of readings
# Of the readings of a block; the fastest one may be a slip. The more of them count, the less they scatter and the more
# they follow how busy the machine is, which cancels where both ways are known.
FAST_TWO_WAY, FAST_ONE_WAY = 0.05, 0.01
FAST_WAYS = 0.5  # of the blocks with requests and answers
MAX_CORRECTION_S = 5e-3  # beyond that one of the two maps is wrong, and nobody can say which
OWN_LINE = -1


@dataclass
class _Set:
    """A set while it plays, and afterwards: where the running map bent."""

    start_s: float
    times_s: array[float] = field(default_factory=lambda: array("d"))
    sources_s: array[float] = field(default_factory=lambda: array("d"))

    def add(self, time_s: float, source_s: float) -> None:
        """A point, unless it is there already."""
        if not self.times_s or (time_s > self.times_s[-1] and source_s > self.sources_s[-1]):
            self.times_s.append(time_s)
            self.sources_s.append(source_s)


@dataclass(frozen=True)
class RetimedSet:
    """Of one set: what ``recorded_s`` says is ``refined_s`` in truth; shape (n,) each, both strictly increasing."""

    start_s: float
    recorded_s: Array
    refined_s: Array


class ClockRetiming:
    """Keeps what is needed to stamp the sets of a campaign anew; cheap enough for every sample.

    Parameters
    ----------
    clock
        The running map of the same device.
    """

    def __init__(self, clock: SourceClock) -> None:
        self._clock = clock
        self._sets: list[_Set] = []
        self._playing: _Set | None = None
        self.reset()

    def reset(self, clock: SourceClock | None = None) -> None:
        """The device begins to count anew: what was learnt of its clock before says nothing any more."""
        self._clock = clock or self._clock
        self._source_s, self._late_s, self._early_s = array("d"), array("d"), array("d")
        self._block = array("d")  # source time, latest and earliest host time of every reading, one after the other
        self._block_end_s = -math.inf
        self._base_s = 0.0
        self._whole = 0
        self._sets.clear()
        self._playing = None
        self._line = OWN_LINE
        self._last = self._sure = (-math.inf, -math.inf)
        self._sure_points = 0

    def observe(self, source_s: float, late_s: float, early_s: float = math.nan) -> None:
        """What the device dates ``source_s`` was so at ``late_s`` of the host at the latest, at ``early_s`` at the
        earliest (NaN where nobody knows)."""
        if source_s >= self._block_end_s:
            if self._block:
                self._close_block()
            else:
                self._base_s = late_s - source_s
            self._block_end_s = source_s + BLOCK_S
        base_s = self._base_s
        self._block.extend((source_s, late_s - source_s - base_s, early_s - source_s - base_s))

    def _close_block(self) -> None:
        source_s, late_s, early_s = np.array(self._block).reshape(-1, 3).T
        del self._block[:]
        drifted_s = self._clock.drift * (source_s - source_s[0])
        way_there_s = drifted_s - early_s
        known = np.flatnonzero(np.isfinite(way_there_s))
        fast = _fast(late_s - drifted_s, FAST_TWO_WAY if len(known) else FAST_ONE_WAY)
        early = math.nan
        if len(known):
            quick = known[_fast(way_there_s[known], FAST_TWO_WAY)]
            early = float(early_s[quick] + drifted_s[fast] - drifted_s[quick])
        for kept, value in ((self._source_s, source_s[fast]), (self._late_s, late_s[fast]), (self._early_s, early)):
            kept.append(float(value))
            if len(kept) > MAX_STORED_BLOCKS:
                del kept[: MAX_STORED_BLOCKS // 2]

    # -- the sets --------------------------------------------------------------------------------

    def begin_set(self, start_s: float) -> None:
        """From here on stamps are recorded."""
        self._playing = _Set(start_s)
        self._line = OWN_LINE
        self._last = self._sure = (-math.inf, -math.inf)
        self._sure_points = 0

    def record(self, time_s: float, source_s: float, line: int) -> None:
        """What the device dates ``source_s`` was recorded at ``time_s``.

        ``line`` is the number of the straight line that the running map was then, ``OWN_LINE`` for a stamp that lies
        on none. A stamp that is not later than the one before is not recorded.
        """
        playing, last = self._playing, self._last
        if playing is None or time_s <= last[0] or source_s <= last[1]:
            return
        if line != self._line or line == OWN_LINE:
            if last[1] > -math.inf:
                playing.add(*last)
            playing.add(time_s, source_s)
            self._line = line
        self._last = (time_s, source_s)

    def end_tick(self) -> None:
        """A tick is whole: what came until here counts. A replay has no more than whole ticks either."""
        self._whole = len(self._source_s)
        self._sure = self._last
        if self._playing is not None:
            self._sure_points = len(self._playing.times_s)

    def end_set(self) -> None:
        """The set is over, whatever ended it."""
        playing, self._playing = self._playing, None
        if playing is None or self._sure[1] == -math.inf:
            return
        del playing.times_s[self._sure_points :], playing.sources_s[self._sure_points :]
        playing.add(*self._sure)
        self._sets.append(playing)

    # -- hindsight -------------------------------------------------------------------------------

    def retimed_sets(self, delay_s: float = 0.0) -> list[RetimedSet]:
        """Every set that can be stamped anew; sets with too few readings around them are left out.

        Parameters
        ----------
        delay_s
            Taken off what the line says, as it was taken off when the sets were recorded.
        """
        source_s, late_s, early_s = (np.array(kept[: self._whole]) for kept in self._kept())
        two_sided = np.isfinite(early_s)
        if 2 * int(two_sided.sum()) >= max(len(source_s), 2 * MIN_LINE_BLOCKS):
            known = _Readings(source_s[two_sided], late_s[two_sided], late_s[two_sided] - early_s[two_sided])
        else:
            known = _Readings(source_s, late_s, None)
        found = (self._retimed(one, known, delay_s + known.most_late_s) for one in self._sets)
        return [one for one in found if one is not None]

    def _kept(self) -> tuple[array[float], array[float], array[float]]:
        return self._source_s, self._late_s, self._early_s

    def _retimed(self, one: _Set, known: _Readings, delay_s: float) -> RetimedSet | None:
        times_s, sources_s = np.array(one.times_s), np.array(one.sources_s)
        offset_s = known.offsets(sources_s)
        if offset_s is None:
            return None
        refined_s = sources_s + (self._base_s - delay_s + offset_s)
        if np.max(np.abs(refined_s - times_s)) > MAX_CORRECTION_S or np.any(np.diff(refined_s) <= 0.0):
            return None
        return RetimedSet(one.start_s, times_s, refined_s)


@dataclass(frozen=True)
class _Readings:
    """Fast readings of all blocks: shape (n,) each, ``way_s`` None where only answers are known."""

    source_s: Array
    late_s: Array
    way_s: Array | None

    @property
    def most_late_s(self) -> float:
        """By how much the lines may be late at most: half the usual fast way there and back, one for the campaign."""
        if self.way_s is None:
            return 0.0
        return 0.5 * max(0.0, float(np.median(self.way_s[self.way_s <= np.quantile(self.way_s, FAST_WAYS)])))

    def offsets(self, at_s: Array) -> Array | None:
        """Host less source time at these source times, in order; None where too little is known."""
        first, last = float(at_s[0]), float(at_s[-1])
        if last - first <= LONGEST_LINE_S:
            line = self._line(first, last)
            return None if line is None else np.asarray(line[1] + line[0] * (at_s - first))
        anchors = np.linspace(first, last, math.ceil((last - first) / LONGEST_LINE_S) + 1)
        lines = [self._line(float(anchor), float(anchor)) for anchor in anchors]
        values = [line[1] for line in lines if line is not None]
        return np.asarray(np.interp(at_s, anchors, values)) if len(values) == len(lines) else None

    def _line(self, first_s: float, last_s: float) -> tuple[float, float] | None:
        """Slope, and value at ``first_s``."""
        near = (self.source_s >= first_s - MARGIN_BESIDE_SET_S) & (self.source_s <= last_s + MARGIN_BESIDE_SET_S)
        if int(near.sum()) < MIN_LINE_BLOCKS:
            return None
        x, late_s = self.source_s[near] - first_s, self.late_s[near]
        if self.way_s is None:
            return lower_line(x, late_s)
        way_s = self.way_s[near]
        fast = way_s <= np.quantile(way_s, FAST_WAYS)
        return middle_line(x[fast], late_s[fast] - 0.5 * way_s[fast])


def _fast(late_s: Array, share: float) -> int:
    """Index of a reading that only this share of the others precedes."""
    rank = int(share * (len(late_s) - 1))
    return int(np.argpartition(late_s, rank)[rank])
