"""The frequency response from torque to rate as measured, line by line, with its coherence.

A torque that repeats is taken apart over whole periods, so that every line falls on a bin and nothing leaks; the
first period, while the start still rings, is left out (Pintelon & Schoukens, System Identification, 2nd ed.,
chapter 2). A long record of a torque like noise is averaged over segments (Welch; Bendat & Piersol, Random Data,
4th ed., chapter 11). A single sweep, or a multisine that is played once, excites each frequency in one or two
segments only, from which no coherence can be told: there response and transient are each taken as a parabola
over a few neighbouring bins of the whole record (local polynomial method; Pintelon & Schoukens, chapter 7).

Coherence is the share of the motion's power that follows the torque linearly. The plain estimate is too high by
about (1 - coherence)^2 / averages (Bendat & Piersol, section 9.2: 1 / averages where there is none), and is
corrected for that here. Units are SI; "rate" stands for speed on a linear axis and "torque" for force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy import fft, signal
from scipy.interpolate import CubicSpline

from identify.frequency.local_polynomial import by_local_polynomial
from identify.frequency.spectra import (
    Complex,
    Record,
    Response,
    chosen,
    coherence_over_periods,
    coherence_over_segments,
    relative_error_of,
    stands_apart,
)
from identify.signals.period import period_of
from rig.recording.run import Array

AVERAGES = 5.0  # that a Welch estimate needs
SEGMENTS = 12  # of one record, half overlapping
RINGS = 2.0  # times the ring that a segment has to hold: shorter ones blur a resonance
SMOOTHING_BINS = 3  # bins either way over which the power of a segment is smoothed before segments are counted
HANN_OVERLAP = 1.056  # half-overlapping Hann segments over independent ones (Bendat & Piersol, chapter 11)
CORRECTED = {"whole periods": coherence_over_periods, "segments": coherence_over_segments}
MIN_RESPONSE_SAMPLES = 64  # samples of a run


def measured_response(records: Sequence[Record], settle_s: float) -> Response | None:
    """The response of one set, its repeats averaged; None where the torque excites nothing.

    Parameters
    ----------
    records
        The set and its repeats: the same torque, length and step.
    settle_s
        How long the platform rings: at least that much is left out before whole periods are counted, up to half
        of the record.
    """
    first = records[0]
    usable = [r for r in records if np.all(np.isfinite(r.motion)) and np.all(np.isfinite(r.torque_nm))]
    if not usable or len(first.torque_nm) < MIN_RESPONSE_SAMPLES or np.ptp(first.torque_nm) == 0.0:
        return None
    period = period_of(first.torque_nm, first.step_s)
    found = None
    if period is not None:
        found = over_periods(usable, period, settle_s)
    if found is None:
        found = over_segments(usable, settle_s)
    if found is None:
        found = by_local_polynomial(usable)
    return _as_rate(found, first) if len(found.frequency_hz) else None


def _as_rate(found: Response, record: Record) -> Response:
    """Rate over the torque as it acted: an angle differentiated, the hold of the torque accounted for."""
    f = found.frequency_hz
    held = np.sinc(f * record.hold_s) * np.exp(-1j * np.pi * f * record.hold_s)
    factor = (2j * np.pi * f if record.of_angle else 1.0) / held
    return Response(f, found.response * factor, found.coherence, found.relative_error, found.averages, found.method)


def over_periods(records: Sequence[Record], period_s: float, settle_s: float) -> Response | None:
    """Cross-spectra at the excited lines over whole periods; None where fewer than two are left.

    Each period is read between its samples onto a grid that holds it exactly.
    """
    step = records[0].step_s
    span = (len(records[0].torque_nm) - 1) * step
    lead = min(max(settle_s, period_s), 0.5 * span)
    count = int((span - lead) / period_s + 1e-6)
    if count * len(records) < 2 or count < 1:
        return None
    n = max(8, round(period_s / step))
    begin = span - count * period_s
    time = begin + period_s * (np.arange(count * n) / n)
    suu: Array = np.zeros(n // 2 + 1)
    syy, syu = np.zeros(n // 2 + 1), np.zeros(n // 2 + 1, dtype=complex)
    for record in records:
        u, y = (_periods(values, step, time, count) for values in (record.torque_nm, record.motion))
        suu = suu + np.sum(np.abs(u) ** 2, axis=0)
        syy = syy + np.sum(np.abs(y) ** 2, axis=0)
        syu = syu + np.sum(y * np.conj(u), axis=0)
    f = np.arange(n // 2 + 1) / period_s
    averages = np.full(len(f), float(count * len(records)))
    return _averaged(f, suu, syy, syu, averages, "whole periods")


def _periods(values: Array, step_s: float, time_s: Array, count: int) -> Complex:
    """Spectra of ``count`` whole periods, (count, lines); what drifts across them is taken out."""
    at = CubicSpline(step_s * np.arange(len(values)), values)(time_s).reshape(count, -1)
    middle = np.mean(at, axis=1, keepdims=True)
    within = np.linspace(-0.5, 0.5, at.shape[1], endpoint=False)
    slope = float(np.polyfit(np.arange(count), middle[:, 0], 1)[0]) if count > 1 else 0.0
    return np.asarray(fft.rfft(at - middle - slope * within, axis=1))


def _averaged(
    f: Array, suu: Array, syy: Array, syu: Complex, averages: Array, method: Literal["whole periods", "segments"]
) -> Response:
    """Response and coherence from averaged spectra, at the lines that the torque excites."""
    at = chosen(f, suu)
    power = suu[at]
    plain = np.abs(syu[at]) ** 2 / np.maximum(power * syy[at], 1e-300)
    coherence = CORRECTED[method](plain, averages[at])
    error = relative_error_of(coherence, averages[at])
    return Response(f[at], syu[at] / power, coherence, error, averages[at], method)


def over_segments(records: Sequence[Record], settle_s: float = 0.0) -> Response | None:
    """Cross-spectra averaged over Hann segments that overlap by half (Welch); None where that does not suit.

    ``averages`` counts the segments that truly excite a line: a sweep is in few of them at any one frequency. It
    does not suit a sweep, lines that stand apart, or a record too short for segments that hold the ring.
    """
    step, n = records[0].step_s, len(records[0].torque_nm)
    length = max(16, 2 * n // (SEGMENTS + 1), round(RINGS * settle_s / step))
    if 2 * n // length < 3 or stands_apart(records[0].torque_nm):
        return None
    window = signal.windows.hann(length, sym=False)
    u, y = (
        np.concatenate([_segments(v, window) for v in series])
        for series in ([r.torque_nm for r in records], [r.motion for r in records])
    )
    power = np.abs(u) ** 2
    suu, syy, syu = power.sum(axis=0), (np.abs(y) ** 2).sum(axis=0), (y * np.conj(u)).sum(axis=0)
    # Smoothed, because the scatter of noise is no structure.
    smooth = np.apply_along_axis(np.convolve, 1, power, np.ones(2 * SMOOTHING_BINS + 1), "same")
    alone = smooth.sum(axis=0) ** 2 / np.maximum((smooth**2).sum(axis=0), 1e-300) / HANN_OVERLAP
    f = fft.rfftfreq(length, step)
    found = _averaged(f, np.where(f < 1.5 / (length * step), 0.0, suu), syy, syu, alone, "segments")
    return found if len(found.averages) and np.median(found.averages) >= AVERAGES else None


def _segments(values: Array, window: Array) -> Complex:
    """Spectra of half-overlapping segments, straight lines taken out, (segments, lines)."""
    n = len(window)
    pieces = np.lib.stride_tricks.sliding_window_view(values, n)[:: n // 2]
    return np.asarray(fft.rfft(signal.detrend(pieces, axis=1) * window, axis=1))
