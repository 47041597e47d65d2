"""What is asked of the axis: steps, trapezoids, sines, chirps and multisines as angle (or torque) over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.signal import lfilter

Rng = np.random.Generator
SOFT_PERIODS = 0.5  # of the lowest frequency, within which a reference grows


def _grown(t: Any, low_hz: float) -> Any:
    """Soft start: 0 to 1 within ``SOFT_PERIODS`` of the lowest frequency, the second derivative continuous."""
    x = np.clip(t * low_hz / SOFT_PERIODS, 0.0, 1.0)
    return x**3 * (10.0 + x * (6.0 * x - 15.0))


def _smoothed(x: Any, step_s: float, time_s: float) -> Any:
    """Behind two equal lags of ``time_s`` seconds."""
    a = math.exp(-step_s / time_s)
    for _ in range(2):
        x, _state = lfilter([1.0 - a], [1.0, -a], x, zi=[a * x[0]])
    return x


def steps(rng: Rng, t: Any, low_hz: float, high_hz: float) -> Any:
    """Random levels, held for random times, with rounded corners."""
    levels, edges = [0.0], [0.0]
    while edges[-1] < t[-1]:
        edges.append(edges[-1] + rng.uniform(0.4, 1.5) / (0.5 * (low_hz * high_hz) ** 0.5 + low_hz))
        levels.append(float(-np.sign(levels[-1] or rng.choice([-1.0, 1.0])) * rng.uniform(0.2, 1.0)))
    x = np.array(levels)[np.searchsorted(edges, t, side="right") - 1]
    return _smoothed(x, t[1] - t[0], 1.0 / (2.0 * math.pi * high_hz))


def trapezoids(rng: Rng, t: Any, low_hz: float, high_hz: float) -> Any:
    """Moves between random angles with trapezoids of the rate, and short pauses."""
    corners, rates = [0.0], [0.0]
    here = 0.0
    while corners[-1] < t[-1]:
        target = float(-np.sign(here or rng.choice([-1.0, 1.0])) * rng.uniform(0.3, 1.0))
        cruise, accelerate = rng.uniform(0.2, 1.0) / (2.0 * low_hz + 0.2 * high_hz), rng.uniform(0.3, 1.0) / high_hz
        pause = rng.uniform(0.1, 0.5) / high_hz
        peak = (target - here) / (cruise + accelerate)
        for span, rate in ((accelerate, peak), (cruise, peak), (accelerate, 0.0), (pause, 0.0)):
            corners.append(corners[-1] + span)
            rates.append(rate)
        here = target
    step = t[1] - t[0]
    rate = np.interp(t, corners, rates)
    return _smoothed(np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * step, step, 0.05 / high_hz)


def sine(rng: Rng, t: Any, low_hz: float, high_hz: float) -> Any:
    """One steady sine."""
    hz = low_hz * (high_hz / low_hz) ** rng.random()
    return _grown(t, hz) * np.sin(2.0 * math.pi * hz * t)


def chirp(rng: Rng, t: Any, low_hz: float, high_hz: float) -> Any:
    """A sweep, logarithmic, of constant rate amplitude."""
    span = t[-1] if t[-1] > 0.0 else 1.0
    ratio = math.log(high_hz / low_hz)
    x = np.clip(t, 0.0, None) / span
    phase = 2.0 * math.pi * low_hz * span / ratio * np.expm1(ratio * x)
    return _grown(t, low_hz) * np.sin(phase) * np.exp(-rng.uniform(0.4, 1.0) * ratio * x)


def multisine(rng: Rng, t: Any, low_hz: float, high_hz: float) -> Any:
    """Many tones of random phases, of falling amplitude."""
    tones = int(rng.integers(5, 21))
    hz = np.geomspace(low_hz, high_hz, tones) * rng.uniform(0.97, 1.03, tones)
    fall = rng.uniform(0.3, 1.0)
    x = np.zeros(len(t))
    for f in hz:
        x += f**-fall * np.sin(2.0 * math.pi * f * t + rng.uniform(0.0, 2.0 * math.pi))
    return _grown(t, low_hz) * x


SHAPES: Mapping[str, Callable[[Rng, Any, float, float], Any]] = {
    "steps": steps, "trapezoids": trapezoids, "sine": sine, "chirp": chirp, "multisine": multisine,
}  # fmt: skip


def reference(shape: str, rng: Rng, t: Any, low_hz: float, high_hz: float) -> tuple[Any, Any]:
    """Values of peak one and their slope (1/s) at evenly spaced times ``t`` in s; zero before t = 0."""
    late = t >= 0.0
    x = np.zeros(len(t))
    x[late] = SHAPES[shape](rng, t[late] - t[late][0], low_hz, high_hz)
    x /= max(float(np.abs(x).max()), 1e-12)
    return x, np.gradient(x, t[1] - t[0])
