"""A delay of each run's own: what torque and rate, stamped by two clocks, cost in what the runs tell of the rest.

What maps two clocks to each other is a line through readings of a busy machine, drawn anew for every set, and off by
microseconds. At a resonance a microsecond turns a part of the spring into damping, and intervals as if one delay held
for all runs would be too narrow by far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.model.parameters import Name
from identify.signals.trace import Trace
from rig.arrays import Array

DELAY: Name = ("torque_delay", "delay")


def have_own_delays(traces: Sequence[Trace], names: Sequence[Name]) -> bool:
    """Whether every run may have a delay of its own: one is fitted, and clocks differ in all of several runs."""
    return DELAY in names and len(traces) > 1 and all(_two_clocks(t) for t in traces)


def _two_clocks(trace: Trace) -> bool:
    run = trace.run
    stamped = trace.torque is not None and run.torque_time_s is not None
    return stamped and not np.array_equal(run.torque_time_s, run.time_s)  # type: ignore[arg-type]


def beside_own_delay(columns: Array, names: Sequence[Name]) -> Array:
    """What the parameters do to one run, (n, p), without what a delay of its own can follow; the delay itself stays."""
    at = list(names).index(DELAY)
    late = columns[:, at]
    power = float(late @ late)
    rest = columns - np.outer(late, late @ columns) / power if power > 0.0 else columns.copy()
    rest[:, at] = late
    return np.asarray(rest)


def freed(covariance: Array, held: Array, names: Sequence[Name]) -> Array:
    """Covariance beside delays of the runs' own, (p, p), and with one for all; of the delay the latter holds."""
    at = list(names).index(DELAY)
    out = covariance.copy()
    out[at], out[:, at] = held[at], held[:, at]
    return out
