"""The period of a signal that repeats, read between its samples."""

from __future__ import annotations

import numpy as np
from scipy import fft, signal

from identify.results import RunTraces
from rig.recording.run import Array

MAX_LATER_DIFFERENCE = 0.03  # the same at its later multiples, where noise and a slow change of amplitude add up
MAX_REPEAT_DIFFERENCE = 3e-3  # of the torque's power: a torque that differs by less from itself a period later repeats


def period_of(values: Array, step_s: float) -> float | None:
    """Period in s of a signal that repeats at least twice behind its first 30 %; None where it does not.

    The lag is read between samples from a parabola through the squared difference of the signal from itself, and
    made sharp over as many periods as there are.
    """
    tail = values[int(0.3 * len(values)) :]
    n = len(tail)
    x = tail - np.mean(tail)
    size = fft.next_fast_len(2 * n)
    product = fft.irfft(np.abs(fft.rfft(x, size)) ** 2, size)[: n // 2 + 1]
    square = np.concatenate([[0.0], np.cumsum(x * x)])
    lags = np.arange(n // 2 + 1)
    energy = square[n - lags] + square[n] - square[lags]
    apart = (energy - 2.0 * product) / np.maximum(energy, 1e-300)  # 0 the same, 1 unrelated, 2 the opposite
    left = np.flatnonzero(apart > 0.1)
    if not np.any(x) or len(left) == 0:
        return None
    begin = left[0]
    dips = begin + signal.find_peaks(-apart[begin:])[0]
    for dip in dips[apart[dips] < 0.2]:
        lag, depth = _lowest(apart, int(dip))
        sharp = _sharpened(apart, lag) if depth < MAX_REPEAT_DIFFERENCE else None
        if sharp is not None:
            return step_s * sharp
    return None


def _lowest(values: Array, at: int) -> tuple[float, float]:
    """Place and depth of the parabola through three values around a minimum."""
    before, here, after = values[at - 1 : at + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return at + shift, here - 0.25 * (before - after) * shift


def _sharpened(apart: Array, lag: float) -> float | None:
    """The period in samples from the largest of its multiples in sight; None where these do not repeat as well."""
    times = 1
    while round(2 * times * lag) + 3 < len(apart):
        times *= 2
        at = round(times * lag)
        near = at - 2 + int(np.argmin(apart[at - 2 : at + 3]))
        place, depth = _lowest(apart, near)
        if depth > MAX_LATER_DIFFERENCE or abs(place - times * lag) > 2.5:
            return None
        lag = place / times
    return lag


def torque_period_s(trace: RunTraces) -> float | None:
    """Of the run's torque; None where it does not repeat."""
    if trace.frequency_hz:
        return 1.0 / trace.frequency_hz
    if trace.torque_nm is None or not np.any(trace.torque_nm):
        return None
    return period_of(trace.torque_nm, float(trace.time_s[-1] - trace.time_s[0]) / (len(trace.time_s) - 1))
