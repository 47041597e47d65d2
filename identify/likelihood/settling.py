"""Samples at the start of a stretch that was cut out of a run: they are measured, but tell nothing of a model.

What is inside the platform is in motion there, and nobody knows how: a flexible mode rings, a spring creeps, friction
holds some of its bristles bent. A model that has such an effect begins it at rest and errs until that has died out, by
many times the noise; one that lacks it does not err more than elsewhere. Behind a gyro, two low-passes in series have a
state that the gains do not follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.signals.trace import Trace
from identify.simulate.shots import SENSOR_LEAD_S

SETTLING_SAMPLES = 10  # of a gyro's filter, at least: one whose time is a sample or two has settled by then
LARGEST_SHARE = 0.25  # of a stretch after a gap, that is left out
LEAD_SHARE, LONGEST_LEAD = 0.2, 500  # of a cut stretch, and in samples: what is left out at most


def settled(traces: Sequence[Trace], use: Sequence[Any] | None = None) -> Sequence[Any] | None:
    """Of ``use`` (one boolean array a run, None: all), what lies late enough after the start of a cut stretch."""
    if not any(t.offset_s > SENSOR_LEAD_S or (_has_gyro(t) and len(t.stretches) > 1) for t in traces):
        return use
    out = []
    for i, trace in enumerate(traces):
        counts = np.ones(len(trace.measured), dtype=bool) if use is None else np.array(use[i], dtype=bool)
        filtered = max(round(SENSOR_LEAD_S / trace.step_s), SETTLING_SAMPLES)
        for k, (a, b) in enumerate(trace.stretches):
            samples = b + 1 - a
            if k == 0 and trace.offset_s > SENSOR_LEAD_S:
                counts[a : a + min(int(LEAD_SHARE * samples), LONGEST_LEAD)] = False
            elif k > 0 and _has_gyro(trace):
                counts[a : a + min(filtered, int(LARGEST_SHARE * samples))] = False
        out.append(counts)
    return out


def _has_gyro(trace: Trace) -> bool:
    return trace.channel == "rate" or trace.beside is not None
