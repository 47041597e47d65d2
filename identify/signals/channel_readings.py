"""What the channels of a run read between and beyond their samples, and which samples a lost reading takes along."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter
from scipy.signal import istft, savgol_filter, stft

from rig.channels import Channel
from rig.recording.run import Array, Run

TABLE_ENTRIES_A_SAMPLE = 8  # of a table: straight between them a 29 Hz acceleration at 1 kHz is right to 4e-5
BRIDGED_S = 0.05  # of lost readings that a straight line may stand for
SMOOTHING_S = 1.0  # no temperature changes faster: readings are smoothed over this, so that their noise does not act
CLEAR = 2.0  # times the noise's power, which is taken off a reading's spectrum: hardly any of it stays
AROUND = 5  # lines, and stretches, over which a reading's power is averaged
STRETCH = 2048  # samples
MAX_SPACING_RATIO = 2.5  # times a channel's own spacing that is no loss: a thermometer is read once a second


def _spacing_s(time_s: Array) -> float:
    return float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf


def lost(run: Run) -> Any:
    """Samples of a run at which one of its causes is unknown: its readings are missing for too long, shape (n,)."""
    out = np.zeros(len(run.time_s), dtype=bool)
    for name in run.causes:
        known = np.isfinite(run.channels[name])
        at = run.time_s[known]
        if known.all() or len(at) < 2:
            continue
        longest = max(BRIDGED_S, MAX_SPACING_RATIO * _spacing_s(at))
        wide = np.nonzero(np.diff(at) > longest)[0]
        for a, b in zip(at[wide], at[wide + 1], strict=True):
            out |= (run.time_s > a) & (run.time_s < b)
        out |= (run.time_s < at[0] - longest) | (run.time_s > at[-1] + longest)
    return out


def table_of(run: Run, channel: Channel, step_s: float) -> tuple[Array, float]:
    """factor * (x - reference) from the start of the run on, and the entries a second.

    A cubic spline where readings come with the samples; straight lines between slower ones and over losses. The
    sensor's noise is taken off: it would push the platform, which rings to it. At its reference throughout where
    the run does not have the channel.
    """
    values = run.channels.get(channel.name)
    known = np.isfinite(values) if values is not None else np.zeros(0, dtype=bool)
    per_s = TABLE_ENTRIES_A_SAMPLE / step_s
    if values is None or known.sum() < 2:
        return np.zeros(2), per_s
    time, x = run.time_s[known] - run.time_s[0], values[known]
    n = max(1, round(float(run.time_s[-1] - run.time_s[0]) / step_s))
    samples = step_s * np.arange(n + 1)
    straight = np.interp(samples, time, x)
    if _spacing_s(time) < 1.5 * step_s:
        right = np.clip(np.searchsorted(time, samples), 1, len(time) - 1)
        near = (time[right] - time[right - 1] < 3.0 * step_s) & (samples <= time[-1])
        straight = np.where(near, CubicSpline(time, x)(samples), straight)
    window = min(round(SMOOTHING_S / step_s), n) // 2 * 2 + 1
    if channel.kind == "temperature" and window > 4 and window <= n:
        straight = savgol_filter(straight, window, 2)
    elif channel.kind != "temperature" and n >= 64:
        straight = _without_noise(straight)
    if n < 4:
        fine = straight
        per_s = 1.0 / step_s
    elif _spacing_s(time) < 1.5 * step_s:
        fine = np.asarray(CubicSpline(samples, straight)(np.arange(n * TABLE_ENTRIES_A_SAMPLE + 1) / per_s))
    else:
        fine = np.interp(np.arange(n * TABLE_ENTRIES_A_SAMPLE + 1) / per_s, samples, straight)
    factor = 1.0 if channel.factor is None else channel.factor
    return np.ascontiguousarray(factor * (fine - (channel.reference or 0.0))), per_s


def _without_noise(x: Array) -> Array:
    """A reading less what its white noise adds to each spectral line of a stretch (Wiener's filter), shape as given.

    The noise's level is the median of the upper half of the spectrum. Stretches overlap and fade into each other;
    at both ends the reading is turned round, so that nothing jumps there.
    """
    size = 2 * (min(STRETCH, len(x) - 1) // 2)
    padded = np.concatenate([2.0 * x[0] - x[size:0:-1], x, 2.0 * x[-1] - x[-2 : -size - 2 : -1]])
    overlap = 3 * size // 4
    _, _, lines = stft(padded, nperseg=size, noverlap=overlap)
    power = np.abs(lines) ** 2
    noise = float(np.median(power[len(power) // 2 :])) / np.log(2.0)
    level = np.maximum(uniform_filter(power, AROUND, mode="nearest"), 1e-300)
    _, left = istft(lines * np.maximum(0.0, 1.0 - CLEAR * noise / level), nperseg=size, noverlap=overlap)
    return np.asarray(left[size : size + len(x)])
