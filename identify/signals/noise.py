"""How noisy a sampled channel is, and how far up it tells anything, read off its spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import signal

from rig.decimation import NOISE_BAND
from rig.recording.run import Array

LOWER = 0.8  # of the periodogram's values
LOWER_MEAN = (1.0 - (1.0 - LOWER) * (1.0 - np.log(1.0 - LOWER))) / LOWER  # of an exponential distribution, its mean one
NOISE_SCATTER = 1.55  # of ``noise_of`` over the root of the number of samples, as a share of itself

MIN_LEVELS = 8  # of a channel, for its steps to be seen
LEVEL_TOLERANCE = 1e-12  # of the largest value: levels that are no farther apart are one
STEP_TOLERANCE = 0.02  # of a step: as near as a file's digits bring them

NOISE_AGREEMENT_SIGMAS = 3.0  # standard errors by which two readings of one noise may differ
WINDOW, TINY = 40, 1e-12  # bins of a spectrum; of their mean, what a bin without power counts as
MAX_LOG_FLATNESS = 1.0  # of a window; 0.58 +- 0.13 for noise, 3.6 to 5.4 for sines bent by friction


MIN_SPECTRUM_SAMPLES = 64  # samples whose spectrum is looked at


def noise_of(values: Array, band: tuple[float, float] = NOISE_BAND) -> float:
    """One standard deviation of the white part of a signal, from the upper half of its spectrum or another ``band``.

    The mean of the lower four fifths of the periodogram there is blind to lines and to a signal below, and scatters
    less than its median; a third difference first takes away what a steep low-frequency signal would leak.
    """
    if len(values) < MIN_SPECTRUM_SAMPLES:
        return float(np.std(np.diff(values, 3)) / np.sqrt(20.0))
    return float(np.sqrt(_mean_of_lower(_power_in(values, band))))


def is_noise(values: Array, band: tuple[float, float] = NOISE_BAND) -> bool:
    """Whether what ``noise_of`` reads in a band is noise, and not motion that reaches up there.

    The periodogram of noise scatters exponentially about its density, whatever colour that has; of motion, played by
    sines and bent by friction or a stop, it is lines with next to nothing between them. In windows that are narrow
    beside any colour, the logarithm of the mean is Euler's constant above the mean of the logarithm for noise (a
    flatness of the spectrum: Gray and Markel 1974).
    """
    if len(values) < MIN_SPECTRUM_SAMPLES:
        return True
    windows = np.array_split(power := _power_in(values, band), max(1, len(power) // WINDOW))
    above = [np.log(np.mean(p)) - np.mean(np.log(np.maximum(p, TINY * np.mean(p)))) for p in windows]
    return float(np.median(above)) < MAX_LOG_FLATNESS


def _power_in(values: Array, band: tuple[float, float]) -> Array:
    """Periodogram in a band, as the variance that white noise of that power has."""
    d = np.diff(values, 3)
    spectrum = np.abs(np.fft.rfft(d * signal.windows.hann(len(d), sym=False))) ** 2
    f = np.arange(len(spectrum)) / len(spectrum)  # of Nyquist
    gain = (2.0 * np.sin(0.5 * np.pi * f)) ** 6
    inside = (f > band[0]) & (f < band[1])
    return np.asarray(spectrum[inside] / gain[inside] / (0.375 * len(d)))


def _mean_of_lower(power: Array) -> float:
    return float(np.mean(np.sort(power)[: round(LOWER * len(power))]) / LOWER_MEAN)


def rounding_of(values: Array) -> float | None:
    """Standard deviation of what a channel loses by its steps, step / sqrt(12); zero without steps, None if few show.

    A platform at rest, or one that sticks, leaves a coarse encoder no noise to be read at all.
    """
    levels = np.unique(values)
    if len(levels) < MIN_LEVELS:
        return None
    apart = np.diff(levels)
    apart = apart[apart > LEVEL_TOLERANCE * float(np.max(np.abs(levels)))]
    step = float(np.min(apart, initial=np.inf))
    steps = apart / step
    whole = bool(np.all(np.abs(steps - np.rint(steps)) < STEP_TOLERANCE * steps))
    return step / float(np.sqrt(12.0)) if len(apart) and whole else 0.0


def bandwidth_of(values: Array, step_s: float) -> float:
    """Highest frequency in Hz at which a signal stands clearly above its noise."""
    nyquist = 0.5 / step_s
    detrend: Any = "linear"  # the stubs of some versions know no name for it
    f, power = signal.welch(values, 1.0 / step_s, nperseg=min(len(values), 1024), detrend=detrend)
    floor = 2.0 * noise_of(values) ** 2 * step_s + 1e-300
    above = np.nonzero(power > 12.0 * floor)[0]
    highest = f[above[-1]] if len(above) else 0.05 * nyquist
    return float(np.clip(1.5 * highest, 0.02 * nyquist, 0.8 * nyquist))


def least_of(found: Sequence[tuple[float, int]]) -> float:
    """The noise that several readings, each of so many samples, show at the least; zero where there is none.

    The mean of the quietest ones that differ by no more than chance: motion that reaches the upper half of the spectrum
    only ever adds to a reading.
    """
    value, weight = 0.0, 0
    for noise, count in sorted(found):
        apart = NOISE_SCATTER * np.sqrt(1.0 / count + (1.0 / weight if weight else 0.0))
        if weight and noise > value * (1.0 + NOISE_AGREEMENT_SIGMAS * apart):
            break
        value, weight = (value * weight + noise * count) / (weight + count), weight + count
    return float(value)
