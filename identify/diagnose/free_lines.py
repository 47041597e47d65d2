"""Steady tones in the residual that no set's excitation makes: a pump, the mains, a fan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from identify.diagnose.harmonics import RINGING_SHARE
from identify.diagnose.memory import RunResiduals
from identify.results import FreeLine
from identify.signals.spectral_lines import RESONANCE_BAND_SHARE
from rig.recording.run import Array

FREE_LINE_POWER_RATIO = 20.0  # times the power around, and times that of the sensor's noise
STEADY = 2.0  # ratio of the amplitudes in both halves
MAX_AMPLITUDE_RATIO = 3.0  # ratio of the amplitudes in two runs
SWING, SWINGS = 0.1, 4  # of the frequency of a free swing, which moves with its amplitude, and of its multiples
MEDIAN_BLOCK_BINS = 40  # bins whose median is what stands around
BESIDE, FOOT = 0.003, 30  # of a stronger line's power within that many bins: its foot, no line
MIN_FREE_LINE_SAMPLES = 256  # samples: a shorter run is not looked at
MOST, PEAKS = 3, 6  # lines that are told of all runs, and peaks that are looked at in one


@dataclass(frozen=True)
class _Line:
    hertz: float
    size: float
    locked: bool | None  # None: its torque does not repeat, so that nobody can say
    run: int


def free_lines(
    runs: Sequence[RunResiduals], periods: Sequence[float | None], natural_hz: float, cutoff_hz: float | None
) -> tuple[tuple[FreeLine, ...], ...]:
    """Of the first two residuals of the runs, the strongest first; the others are draws of noise.

    A line is free where it stands in at least two runs (of several) at one frequency and at a like size, and in one
    of them at no multiple of what was played.
    """
    lines: tuple[list[_Line], list[_Line]] = ([], [])
    for i, (run, period) in enumerate(zip(runs, periods, strict=True)):
        for found, several in zip(_lines(run, period, i, natural_hz, cutoff_hz), lines, strict=True):
            several.extend(found)
    return tuple(_grouped(several, runs) for several in lines)


def without_lines(run: RunResiduals, lines: Sequence[Sequence[FreeLine]]) -> RunResiduals:
    """The run with the free lines of each model taken out of its residual."""
    left = run.left.copy()
    time = run.step_s * np.arange(len(left))
    for i, several in enumerate(lines):
        for line in several:
            turn = 2.0 * np.pi * line.frequency_hz * time
            wave = np.column_stack([np.cos(turn), np.sin(turn)])
            left[:, i] -= run.use * (wave @ np.linalg.lstsq(wave[run.use], left[run.use, i], rcond=None)[0])
    return replace(run, left=left)


def _lines(
    run: RunResiduals, period_s: float | None, number: int, natural_hz: float, cutoff_hz: float | None
) -> tuple[list[_Line], list[_Line]]:
    """The steady lines of one run in the residual of either model."""
    left, step = run.left[int(RINGING_SHARE * len(run.use)) :], run.step_s
    n = len(left)
    if n < MIN_FREE_LINE_SAMPLES:
        return [], []
    size = fft.next_fast_len(2 * n, real=True)
    power = np.abs(fft.rfft(left.T * np.hanning(n), size)) ** 2
    hertz = np.fft.rfftfreq(size, step)
    width = 1.0 / (n * step)
    noise = np.convolve(np.mean(power[2:], axis=0), np.full(9, 1.0 / 9.0), "same")
    use = (hertz > 3.0 * width) & (hertz < (cutoff_hz or np.inf))
    use &= np.abs(hertz - natural_hz) > max(RESONANCE_BAND_SHARE * natural_hz, 2.0 * width)
    if not np.any(run.torque):
        use &= ~_of_swing(hertz, run, width)
    out: tuple[list[_Line], list[_Line]] = ([], [])
    for which in (0, 1):
        for k in _peaks(power[which], noise, use):
            f = _top(np.log(power[which, k - 1 : k + 2] + 1e-300), float(hertz[k]), float(hertz[1]))
            halves = [_amplitude(part, f, step) for part in (left[: n // 2, which], left[n // 2 :, which])]
            if max(halves) < STEADY * min(halves):
                line = _Line(f, _amplitude(left[:, which], f, step), _locked(f, run, period_s, width), number)
                out[which].append(line)
    return out


def _of_swing(hertz: Array, run: RunResiduals, width: float) -> NDArray[np.bool_]:
    """Whether a frequency is that of a free swing or a multiple, whatever the amplitude has made of it, (m,)."""
    angle = (run.angle - np.mean(run.angle)) * np.hanning(len(run.angle))
    power = np.abs(fft.rfft(angle, fft.next_fast_len(len(angle), real=True)))
    swing = float(np.argmax(power)) / (run.step_s * fft.next_fast_len(len(angle), real=True))
    if swing <= 0.0:
        return np.zeros(len(hertz), dtype=bool)
    multiple = np.clip(np.rint(hertz / swing), 1.0, SWINGS)
    return np.asarray(np.abs(hertz - multiple * swing) < np.maximum(SWING * multiple * swing, 2.0 * width))


def _peaks(power: Array, noise: Array, use: NDArray[np.bool_]) -> list[int]:
    """Bins of the peaks that stand out of what is around, the strongest first."""
    around = np.maximum(_around(power), noise)
    inner = np.arange(1, len(power) - 1)
    peak = inner[(power[inner] > power[inner - 1]) & (power[inner] >= power[inner + 1])]
    peak = peak[use[peak] & (power[peak] > FREE_LINE_POWER_RATIO * around[peak])]
    peak = peak[np.argsort(-power[peak])]
    return [int(k) for k in peak if power[k] > BESIDE * np.max(power[max(k - FOOT, 0) : k + FOOT + 1])][:PEAKS]


def _around(power: Array) -> Array:
    """Mean power of noise about each bin, from medians of blocks, (m,)."""
    blocks = max(1, len(power) // MEDIAN_BLOCK_BINS)
    whole = power[: blocks * MEDIAN_BLOCK_BINS] if len(power) >= MEDIAN_BLOCK_BINS else power
    median = np.median(whole.reshape(blocks, -1), axis=1) / np.log(2.0)
    return np.interp(np.arange(len(power)), (np.arange(blocks) + 0.5) * MEDIAN_BLOCK_BINS, median)


def _top(three: Array, at: float, step: float) -> float:
    """Place of the parabola through the logarithms at a peak."""
    bend = three[0] - 2.0 * three[1] + three[2]
    return float(at + step * 0.5 * (three[0] - three[2]) / bend) if bend < 0.0 else float(at)


def _amplitude(y: Array, hertz: float, step_s: float) -> float:
    window = np.hanning(len(y))
    turn = np.exp(-2j * np.pi * hertz * step_s * np.arange(len(y)))
    return float(2.0 * abs(np.sum(window * y * turn)) / np.sum(window))


def _locked(hertz: float, run: RunResiduals, period_s: float | None, width: float) -> bool | None:
    if period_s:
        multiple = max(round(hertz * period_s), 1)
        return bool(abs(hertz - multiple / period_s) < width)  # NumPy's False is not False
    return None if np.any(run.torque) else False


def _grouped(lines: Sequence[_Line], runs: Sequence[RunResiduals]) -> tuple[FreeLine, ...]:
    found, left = [], sorted(lines, key=lambda line: -line.size)
    width = max((1.0 / ((1.0 - RINGING_SHARE) * len(r.use) * r.step_s) for r in runs), default=0.0)
    while left:
        lead = left[0]
        near = [x for x in left if abs(x.hertz - lead.hertz) < width]
        left = [x for x in left if x not in near]
        sizes = [x.size for x in near]
        several = len({x.run for x in near}) >= min(2, len(runs))
        if several and any(x.locked is False for x in near) and max(sizes) < MAX_AMPLITUDE_RATIO * min(sizes):
            hertz = float(np.median([x.hertz for x in near]))
            found.append(FreeLine(hertz, float(np.median(sizes)), len({x.run for x in near})))
    return tuple(found[:MOST])
