"""What a gyroscope's own low-pass does to the rate, from the two numbers its data sheet gives.

A sensor with a corner and a constant group delay averages the rate symmetrically around the instant that
its delay-corrected time stamp names. In its pass band that changes nothing; corners of the rate, where
friction reverses or a held torque steps, it rounds. A prediction that is to agree with the samples down to
their noise has to be rounded alike.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from rig.arrays import Array

CORNER_ENTRIES = 32  # of a table over the delay
_BISECTIONS = 60
_STEEPEST = 400.0


@lru_cache(maxsize=64)
def low_pass_kernel(corner_hz: float, delay_s: float, step_s: float, averaged_s: float = 0.0) -> Array:
    """Weights on a grid, shape (2 n + 1,): symmetric over twice the delay, -3 dB at the corner, sum one.

    A power of a cosine times (a + b t^2) whose second moment is zero: flat to fourth order in its pass band
    (the paper's ring at 29 Hz passes a 262 Hz filter to 7e-5). Where the delay is too short for a filter that
    flat, the power alone. What it is applied to may be averages over ``averaged_s`` already: both together are then as
    said.
    """
    n = round(delay_s / step_s)
    if n < 1:
        return np.ones(1)
    t = step_s * np.arange(-n, n + 1)
    averages = float(np.sinc(corner_hz * averaged_s))
    bell = np.cos(0.5 * np.pi * t / ((n + 0.5) * step_s))

    def flat(power: float) -> Array:
        g = bell**power
        m0, m2, m4 = (float(np.sum(g * t**k)) for k in (0, 2, 4))
        spread = averaged_s**2 / 12.0
        return np.asarray(g * (m4 + spread * m2 - (m2 + spread * m0) * t**2) / (m0 * m4 - m2 * m2))

    def plain(power: float) -> Array:
        return np.asarray(bell**power / np.sum(bell**power))

    def passes(weights: Array) -> bool:
        return averages * float(np.sum(weights * np.cos(2.0 * math.pi * corner_hz * t))) > math.sqrt(0.5)

    shape = plain if passes(flat(0.0)) else flat
    wide, narrow = 0.0, _STEEPEST  # a steeper bell is a shorter average and passes more
    for _ in range(_BISECTIONS):
        power = 0.5 * (wide + narrow)
        wide, narrow = (wide, power) if passes(shape(power)) else (power, narrow)
    return shape(0.5 * (wide + narrow))


@lru_cache(maxsize=8)
def corner_table(corner_hz: float, delay_s: float) -> Array:
    """What such a filter adds to a rate beside a corner in it, shape (n + 1,), s: per jump of the acceleration.

    Entries stand for distances from the corner from none to ``delay_s``, evenly spaced. Half the jump times the
    distance is the corner's part of the rate, and the filter averages it.
    """
    step_s = delay_s / CORNER_ENTRIES
    kernel = low_pass_kernel(corner_hz, delay_s, step_s)
    beside = step_s * np.arange(-2 * CORNER_ENTRIES, 2 * CORNER_ENTRIES + 1)
    added = smoothed(np.abs(beside), kernel) - np.abs(beside)
    middle = len(beside) // 2
    return np.ascontiguousarray(0.5 * added[middle : middle + CORNER_ENTRIES + 1])


def mean_rate(angle: Array, rate: Array, step_s: float) -> Array:
    """Mean over the step before and the step after each instant, shape as given; at the ends the rate itself.

    What a held torque makes of the rate in between, a ripple at the frequency of the ticks, falls out of an average but
    not out of single values, whatever is averaged afterwards.
    """
    mean = rate.copy()
    mean[1:-1] = (angle[2:] - angle[:-2]) / (2.0 * step_s)
    return mean


def smoothed(rate: Array, kernel: Array) -> Array:
    """The rate behind such a filter, shape as given; the ends go on as they are."""
    n = len(kernel) // 2
    if not n:
        return rate
    return np.asarray(np.convolve(np.pad(rate, n, mode="edge"), kernel, mode="valid"))
