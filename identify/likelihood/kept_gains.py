"""The gains of every run, computed once for runs that were sampled alike."""

from __future__ import annotations

from dataclasses import replace
from threading import Lock
from typing import Any

import numpy as np

from identify.signals.trace import Trace
from rig.dynamics.gains import Gains, Noise, Sensing, StartVariance, gains_of
from rig.dynamics.linear_part import LinearPart

SAME_STEP = 1e-5  # relative: what steps of runs differ by and are the same to a gain
GAIN_CACHE_SIZE = 12  # of runs that were sampled alike


class KeptGains:
    """The last few gains of a set of runs.

    Parameters
    ----------
    step_s, longest
        The step that most runs have, and the samples of the longest run.
    """

    def __init__(self, step_s: float, longest: int) -> None:
        self.step_s, self.longest = step_s, longest
        self._gains: dict[tuple[object, ...], tuple[dict[tuple[object, ...], Gains], Lock]] = {}

    def of(
        self, trace: Trace, linear: LinearPart, noise: Noise, sensing: Sensing, spans: list[tuple[int, int]],
        begun: StartVariance, in_motion: tuple[bool, ...] = (),
    ) -> Gains:  # fmt: skip
        """A run's gains; the last few are kept, because most looks change an effect and not the linear part.

        ``begun`` is how well the start of a stretch is known, ``in_motion`` whether each begins in motion.
        """
        keep, spans, usable, group = self._same_sampling(trace, spans)
        in_motion = tuple(in_motion[k] for k in usable) if linear.states else ()
        even = abs(trace.step_s / self.step_s - 1.0) < SAME_STEP
        step_s = self.step_s if even else trace.step_s
        key = (linear, noise, sensing, step_s, begun, in_motion, *spans)
        kept, lock = self._gains.setdefault(group, ({}, Lock()))
        with lock:
            found = kept.get(key)
            if found is None:
                found = gains_of(linear, noise, step_s, sensing, keep, spans, begun, in_motion)
                for old in list(kept)[: max(0, len(kept) + 1 - GAIN_CACHE_SIZE)]:
                    kept.pop(old, None)
                kept[key] = found
        n = len(trace.measured)
        return found if n == len(found.gain) else replace(found, gain=found.gain[:n], variance=found.variance[:n])

    def _same_sampling(
        self, trace: Trace, spans: list[tuple[int, int]]
    ) -> tuple[Any, list[tuple[int, int]], list[int], tuple[object, ...]]:
        """Samples, spans, which of the run's they are, and a name for runs of the same gains, as far as they go.

        Gains know nothing of what was measured: runs of one piece without a lost sample differ in their length alone.
        """
        keep = np.asarray(trace.keep, dtype=bool)
        seen = np.flatnonzero(keep)
        usable = [k for k, (a, b) in enumerate(spans) if np.any(keep[a : b + 1])]
        if len(usable) == 1 and seen[-1] - seen[0] + 1 == len(seen):
            n, lead = self.longest, int(seen[0])
            return np.arange(n) >= lead, [(spans[usable[0]][0], n - 1)], usable, (lead,)
        return keep, spans, list(range(len(spans))), (keep.tobytes(),)
