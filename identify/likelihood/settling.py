"""Samples at the start of a stretch that was cut out of a gyro's run: they are measured, but tell nothing of a model.

The gyro's low-pass is in motion there, and the gains follow no more of it than its output and its slope. Two in series
(the gyro's own and its filter's) have a third state. Until that has died out a prediction errs by many times the noise,
and the fit would move the lags to where the first samples are predicted best.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.signals.trace import Trace
from identify.simulate.shots import SENSOR_LEAD_S

SETTLING_SAMPLES = 10  # at least: a filter whose time is a sample or two has settled by then
LARGEST_SHARE = 0.25  # of a stretch, that is left out


def settled(traces: Sequence[Trace], use: Sequence[Any] | None = None) -> Sequence[Any] | None:
    """Of ``use`` (one boolean array a run, None: all), what lies late enough after the start of a cut stretch."""
    if not any(t.channel == "rate" or t.beside is not None for t in traces):
        return use
    out = []
    for i, trace in enumerate(traces):
        counts = np.ones(len(trace.measured), dtype=bool) if use is None else np.array(use[i], dtype=bool)
        lead = max(round(SENSOR_LEAD_S / trace.step_s), SETTLING_SAMPLES)
        for a, b in trace.stretches:
            if trace.offset_s + a * trace.step_s > SENSOR_LEAD_S:
                counts[a : a + min(lead, int(LARGEST_SHARE * (b + 1 - a)))] = False
        out.append(counts)
    return out
