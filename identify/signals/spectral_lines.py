"""Spectral lines in what free runs leave that nothing in the rig itself makes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal

from identify.signals.trace import UPSAMPLING, Trace
from rig.recording.run import Array

RESONANCE_BAND_SHARE = 0.03  # of the natural frequency: a line that near is the platform's own ring
TONE_POWER_SHARE = 0.8  # of the torque's power in one line
RUN_START_S = 0.5  # in which a sharp mode that nothing excites later has rung
RING_POWER_RATIO = 5.0  # times the median power
MAX_RINGS = 2  # frequencies, the strongest
LINE = 4.0  # times the noise at which a spectral line is one: e^-16 is the chance of a bin


def foreign_lines_hz(
    traces: Sequence[Trace], residuals: Sequence[Array], noise: float, natural_hz: float
) -> tuple[float, ...]:
    """Frequencies of the strongest lines that come from outside, in Hz.

    A harmonic of the excitation belongs to a nonlinearity, and a line at the natural frequency to whatever
    rings the platform: neither comes from outside.

    Parameters
    ----------
    residuals
        Measured minus simulated, one array (n,) a trace.
    noise
        One standard deviation of the measured channel.
    natural_hz
        Natural frequency of the platform; zero without a spring.
    """
    found: list[tuple[float, float]] = []
    for trace, r in zip(traces, residuals, strict=True):
        x = np.where(trace.keep, r, 0.0) * signal.windows.hann(len(r))
        size = np.abs(np.fft.rfft(x, 8 * len(x))) / (noise * np.sqrt(0.375 * len(x)))
        f = np.fft.rfftfreq(8 * len(x), trace.step_s)
        width = 2.0 / (trace.step_s * len(x))
        size[f < width] = 0.0
        size[np.abs(f - natural_hz) < max(RESONANCE_BAND_SHARE * natural_hz, width)] = 0.0
        played = played_hz(trace)
        if played is not None:
            size[np.abs(f - played * np.maximum(np.rint(f / played), 1.0)) < width] = 0.0
        peaks = signal.find_peaks(size, height=LINE)[0]
        found += [(float(size[k]), float(f[k])) for k in peaks[np.argsort(size[peaks])[-3:]]]
    found.sort(reverse=True)
    return tuple(f for _, f in found[:8])


def rings_hz(traces: Sequence[Trace], residuals: Sequence[Array], natural_hz: float) -> tuple[float, ...]:
    """Frequencies in Hz at which most is left where runs begin, the strongest first; not the natural frequency."""
    length = min(round(RUN_START_S / traces[0].step_s), *(len(r) for r in residuals))
    window = 0.5 + 0.5 * np.cos(np.pi * np.arange(length) / length)  # all of the beginning
    power = np.zeros(2 * length + 1)
    for trace, r in zip(traces, residuals, strict=True):
        first = trace.stretches[0][0] if trace.stretches else 0
        x = np.where(trace.keep, r, 0.0)[first : first + length]
        if len(x) == length:
            power += np.abs(np.fft.rfft(x * window, 4 * length)) ** 2
    f = np.fft.rfftfreq(4 * length, traces[0].step_s)
    power[(np.abs(f - natural_hz) < 2.0 / RUN_START_S) | (f < 2.0 / RUN_START_S)] = 0.0
    peaks = signal.find_peaks(power, height=RING_POWER_RATIO * float(np.median(power)))[0]
    return tuple(float(f[k]) for k in peaks[np.argsort(-power[peaks])][:MAX_RINGS])


def ringing_hz(traces: Sequence[Trace], natural_hz: float) -> float:
    """Frequency of the strongest line of the measured motion next to the natural frequency in Hz; zero without."""
    found: list[tuple[float, float]] = []
    for trace in traces:
        x = np.where(trace.keep, trace.measured, 0.0)
        size = np.abs(np.fft.rfft((x - np.mean(x)) * signal.windows.hann(len(x)), 8 * len(x)))
        f = np.fft.rfftfreq(8 * len(x), trace.step_s)
        near = np.flatnonzero(np.abs(f - natural_hz) < RESONANCE_BAND_SHARE * natural_hz)
        if near.size:
            k = near[np.argmax(size[near])]
            found.append((float(size[k]), float(f[k])))
    return max(found, default=(0.0, 0.0))[1]


def played_hz(trace: Trace) -> float | None:
    """Frequency of a run's torque where that is one tone."""
    if trace.run.frequency_hz:
        return trace.run.frequency_hz
    if trace.torque is None:
        return None
    torque = trace.fine[3][::UPSAMPLING]
    power = np.abs(np.fft.rfft((torque - np.mean(torque)) * signal.windows.hann(len(torque)))) ** 2
    k = int(np.argmax(power))
    around = slice(max(k - 2, 0), k + 3)
    if np.sum(power[around]) < TONE_POWER_SHARE * np.sum(power):
        return None
    f = np.fft.rfftfreq(len(torque), trace.step_s)
    return float(np.sum(f[around] * power[around]) / np.sum(power[around]))
