"""A delay of each run's own: what torque and rate, stamped by two clocks, cost in what the runs tell of the rest.

What maps two clocks to each other is a line through readings of a busy machine, drawn anew for every set, and off by
microseconds in level and in slope. At a resonance a microsecond turns a part of the spring into damping, and intervals
as if one delay held for all runs, and all along each of them, would be too narrow by far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identify.estimate.covariance import orthogonal_part
from identify.model.parameters import Name
from identify.signals.trace import Trace
from rig.arrays import Array

DELAY_NAME: Name = ("torque_delay", "delay")


def have_own_delays(traces: Sequence[Trace], names: Sequence[Name]) -> bool:
    """Whether every run may have a delay of its own: one is fitted, and clocks differ in all of several runs."""
    return DELAY_NAME in names and len(traces) > 1 and all(_two_clocks(t) for t in traces)


def _two_clocks(trace: Trace) -> bool:
    run = trace.run
    stamped = trace.torque is not None and run.torque_time_s is not None
    return stamped and not np.array_equal(run.torque_time_s, run.time_s)  # type: ignore[arg-type]


def position(trace: Trace, counted: Array, readings: int = 1) -> Array:
    """Where in its run each reading that counts lies, (n,): from -1 at the first sample to 1 at the last."""
    along = np.linspace(-1.0, 1.0, len(trace.measured))[counted]
    return np.repeat(along, readings)


def of_own_clock(columns: Array, names: Sequence[Name], along: Array) -> Array:
    """What a delay of one run's own does that may change evenly along the run, (n, 2): its middle, and half its change.

    Parameters
    ----------
    columns
        What the parameters do to the run, (n, p).
    along
        Where in the run each row lies, (n,), as from ``position``.
    """
    late = columns[:, list(names).index(DELAY_NAME)]
    return np.column_stack([late, along * late])


def beside_own_delay(columns: Array, names: Sequence[Name], along: Array) -> Array:
    """What the parameters do to one run, (n, p), without what such a delay can follow; the delay itself stays."""
    at = list(names).index(DELAY_NAME)
    rest = np.array(orthogonal_part(of_own_clock(columns, names, along), columns))
    rest[:, at] = columns[:, at]
    return rest


def freed(covariance: Array, held: Array, names: Sequence[Name]) -> Array:
    """Covariance beside delays of the runs' own, (p, p), and with one for all; of the delay the latter holds."""
    at = list(names).index(DELAY_NAME)
    out = covariance.copy()
    out[at], out[:, at] = held[at], held[:, at]
    return out
