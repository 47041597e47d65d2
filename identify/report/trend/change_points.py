"""Where a quantity jumps to another level between two campaigns.

The rule: levels are constant between changes; a campaign scatters about its level by its own interval and by what
campaigns of this rig scatter anyway. That second part is read from the steps between neighbours: from their median
absolute value, which a few jumps do not move. Of all ways to cut the series into levels of at least two campaigns the
one counts that has the least sum of squared deviations, in standard deviations, plus ``PENALTY`` ln n for each level
beyond the first. A single campaign that is off is an outlier: it weighs next to nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rig.arrays import Array

# The BIC counts two numbers for a change, its place and its level: 2 ln n. The place costs one more (Zhang and Siegmund
# 2007).
PENALTY = 3.0
MIN_LEVEL_CAMPAIGNS = 2  # campaigns of a level; a single one that is off is an outlier
MIN_CAMPAIGNS = 6  # campaigns: with fewer, the scatter is not known
# The median of few steps is often too small, and every deviation then seems a change: its square is raised by this
# over n. Of 100 series of 8 campaigns without a change 14 showed one without it, 7 do with it
# (`python -m benchmarks.batch --changes`).
SPARE = 8.0
CHANGE_SIGMAS = 4.0  # standard deviations; chance shows one such step in 16000
MEDIAN_OF_NORMAL = 0.6745  # median of |x| in standard deviations


@dataclass(frozen=True)
class Level:
    """A stretch of campaigns at one level.

    ``first`` and ``last`` count from 0 and are both part of it; ``std_error`` is that of ``mean``.
    """

    first: int
    last: int
    mean: float
    std_error: float


def levels(values: Array, std_errors: Array) -> tuple[Level, ...]:
    """The levels of a series, first to last; one where nothing changes or where there are too few campaigns.

    Parameters
    ----------
    values
        Shape (n,), in the order of time, all finite.
    std_errors
        Shape (n,), in the unit of the values; 0 where a value has no interval.
    """
    n = len(values)
    if n == 0:
        return ()
    sigma = np.sqrt(std_errors**2 + scatter(values, std_errors) ** 2)
    sigma = np.maximum(sigma, max(1e-9 * float(np.max(np.abs(values))), 1e-150))  # of equal values nothing scatters
    weights = 1.0 / np.maximum(sigma, _lonely(values, sigma)) ** 2
    cuts = _cuts(values, weights) if n >= MIN_CAMPAIGNS else [0, n]
    out = []
    for first, end in pairwise(cuts):
        w = weights[first:end]
        mean = float(np.average(values[first:end], weights=w))
        out.append(Level(first, end - 1, mean, float(1.0 / math.sqrt(w.sum()))))
    return tuple(out)


def scatter(values: Array, std_errors: Array) -> float:
    """Standard deviation from campaign to campaign beyond the intervals, in the unit of the values."""
    if len(values) < MIN_CAMPAIGNS:
        return 0.0
    steps = np.abs(np.diff(values))
    of_steps = (float(np.median(steps)) / MEDIAN_OF_NORMAL) ** 2 / 2.0 * (1.0 + SPARE / len(values))
    return math.sqrt(max(0.0, of_steps - float(np.median(std_errors)) ** 2))


def _lonely(values: Array, sigma: Array) -> Array:
    """How far a campaign is off that stands alone, shape (n,); 0 for all others. It then weighs next to nothing.

    Alone is what lies beyond both neighbours by more than ``CHANGE_SIGMAS`` standard deviations of such a step; the
    first and the last, beyond the next two.
    """
    n = len(values)
    out = np.zeros(n)
    if n < MIN_CAMPAIGNS:
        return out
    i = np.arange(n)
    near = np.stack([np.where(i == 0, 2, i - 1), np.where(i == n - 1, n - 3, i + 1)])
    steps = values - values[near]
    far = np.abs(steps) > CHANGE_SIGMAS * np.hypot(sigma, sigma[near])
    alone = far.all(axis=0) & (steps[0] * steps[1] > 0.0)
    out[alone] = np.abs(steps).max(axis=0)[alone]
    return out


def _cuts(values: Array, weights: Array) -> list[int]:
    """Where levels begin, and the end: the best of all ways to cut, by dynamic programming in n^2 steps."""
    n = len(values)
    x = values - np.average(values, weights=weights)  # the sums below lose no digits to a common offset
    w, wx, wxx = (np.concatenate([[0.0], np.cumsum(weights * x**k)]) for k in range(3))
    penalty = PENALTY * math.log(n)
    best, came_from = np.full(n + 1, np.inf), np.zeros(n + 1, dtype=int)
    best[0] = -penalty
    for end in range(MIN_LEVEL_CAMPAIGNS, n + 1):
        start = np.arange(0, end - MIN_LEVEL_CAMPAIGNS + 1)
        cost = (wxx[end] - wxx[start]) - (wx[end] - wx[start]) ** 2 / (w[end] - w[start])
        total = best[start] + cost + penalty
        came_from[end] = int(np.argmin(total))
        best[end] = total[came_from[end]]
    cuts = [n]
    while cuts[-1] > 0:
        cuts.append(int(came_from[cuts[-1]]))
    return cuts[::-1]
