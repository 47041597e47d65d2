"""Random series: coloured disturbance, flicker and walk of a gyro, stamps of a software loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

Rng = np.random.Generator
FLICKER_TIMES_S = (0.1, 1.0, 10.0)  # equal variances a decade apart: 1/f between 0.02 and 2 Hz within 10 %


def relaxing(rng: Rng, n: int, step_s: float, rms: float, time_s: float) -> Any:
    """Stationary first-order (Ornstein-Uhlenbeck) noise of a given rms and time constant, shape (n,)."""
    a = math.exp(-step_s / time_s)
    kicks = rms * math.sqrt(1.0 - a * a) * rng.standard_normal(n)
    kicks[0] = rms * rng.standard_normal()
    return lfilter([1.0], [1.0, -a], kicks)


def flicker(rng: Rng, n: int, step_s: float, rms: float) -> Any:
    """1/f noise as a sum of relaxations, shape (n,)."""
    each = rms / math.sqrt(len(FLICKER_TIMES_S))
    return np.sum([relaxing(rng, n, step_s, each, t) for t in FLICKER_TIMES_S], axis=0)


def walk(rng: Rng, n: int, step_s: float, per_root_s: float) -> Any:
    """Random walk from zero that grows by ``per_root_s`` a root second, shape (n,)."""
    return np.cumsum(per_root_s * math.sqrt(step_s) * rng.standard_normal(n))


def lagged(x: Any, a: float) -> Any:
    """First-order lag of pole ``a`` of a series that runs linearly between its values, started at rest on the first."""
    steps = -1.0 / math.log(a)
    now = 1.0 - steps * (1.0 - a)
    y, _ = lfilter([now, 1.0 - a - now], [1.0, -a], x, zi=[(1.0 - now) * x[0]])
    return y


def low_pass(x: Any, step_s: float, corner_hz: float) -> Any:
    """Second-order Butterworth low-pass, started at rest on the first value."""
    b, a = butter(2, corner_hz, fs=1.0 / step_s)
    state = np.array([b[1] + b[2] - (a[1] + a[2]) * b[0], b[2] - a[2] * b[0]]) * x[0]
    y, _ = lfilter(b, a, x, zi=state)
    return y


def filtered_white(rng: Rng, n: int, step_s: float, rms: float, corner_hz: float) -> Any:
    """White noise behind the low-pass of ``low_pass``, of a given rms, shape (n,)."""
    b, a = butter(2, corner_hz, fs=1.0 / step_s)
    pulse = np.zeros(max(64, math.ceil(4.0 / (corner_hz * step_s))))
    pulse[0] = 1.0
    gain = math.sqrt(float(np.sum(lfilter(b, a, pulse) ** 2)))
    return lfilter(b, a, rng.standard_normal(n)) * (rms / gain)


def instants(rng: Rng, n: int, fine: int, jitter: float, wander: float) -> Any:
    """Indices of the fine steps at which n samples are taken, ``fine`` a sample on average.

    ``jitter`` (white) and ``wander`` (slow) are rms in parts of a sample. Always rising.
    """
    slow = wander * np.sin(2.0 * math.pi * (np.arange(n) / n * rng.uniform(2.0, 9.0) + rng.random())) * math.sqrt(2.0)
    at = np.rint((np.arange(n) + slow - slow[0] + jitter * rng.standard_normal(n)) * fine).astype(np.int64)
    at[0] = 0
    return np.maximum.accumulate(np.maximum(at, 0) - np.arange(n)) + np.arange(n)


def kept(rng: Rng, n: int, share_lost: float, longest: int) -> Any:
    """Which of n samples arrived, shape (n,) of bool: single losses and a few gaps; the ends arrive."""
    good = rng.random(n) >= share_lost
    if share_lost > 0.0:
        for _ in range(int(rng.integers(0, 4))):
            at = int(rng.integers(10, max(11, n - longest - 10)))
            good[at : at + int(rng.integers(2, longest + 1))] = False
    good[[0, -1]] = True
    return good


def draw_between(rng: Rng, low: float, high: float) -> float:
    """Log-uniform."""
    return float(low * (high / low) ** rng.random())


def rms_of(parts: Sequence[Any]) -> float:
    """Root of the mean square of several arrays together."""
    x = np.concatenate([np.ravel(p) for p in parts])
    return float(np.sqrt(np.mean(np.square(x))))
