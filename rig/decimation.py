"""The low-passes before a decimation, as weights around a sample, and how a recording is looked at to choose one."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import signal

from rig.arrays import Array

SAMPLES_A_PERIOD = 8.0  # of the fastest motion that stands above the noise: beyond, a sample tells nothing new
SPAN_STARTS = 12  # where a span may begin
NOISE_BAND = (0.5, 0.98)  # of the Nyquist frequency: where the noise is read
REACH = 16  # new samples to either side
# Of the new Nyquist frequency: flat to 2e-5 up to 0.65 of it, and as far down above 1.35. With a smaller one the filter
# rings for longer than ``REACH``.
ROLL_OFF = 0.35
# A sharp one: flat to 1e-5 up to 0.6 of the new Nyquist frequency and 100 dB down above it.
PASSED, KAISER = 0.8, 10.0  # cut-off over the new Nyquist frequency, window


@lru_cache(maxsize=32)
def sharp(factor: int) -> Array:
    """Weights of shape (2 REACH factor + 1,) of a low-pass below the new Nyquist frequency."""
    return np.asarray(signal.firwin(2 * REACH * factor + 1, PASSED / factor, window=("kaiser", KAISER)))


@lru_cache(maxsize=32)
def keeps_white(factor: int) -> Array:
    """Weights of shape (2 REACH factor + 1,) of a low-pass behind which, decimated, white noise is white again.

    A sharper one leaves a hole below the new Nyquist frequency, and a likelihood takes the noise for coloured. The
    squares of this one (Meyer's scaling function: Daubechies, Ten Lectures on Wavelets, 5.2) and of its aliases add
    up to one at every frequency.
    """
    count = 64 * REACH * factor
    of_new_rate = np.abs(np.fft.fftfreq(count)) * factor
    x = np.clip((of_new_rate - 0.5 * (1.0 - ROLL_OFF)) / ROLL_OFF, 0.0, 1.0)
    passes = np.cos(0.5 * np.pi * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3))
    response = np.fft.fftshift(np.fft.ifft(passes).real)
    middle, order = count // 2, REACH * factor
    weights = response[middle - order : middle + order + 1]
    return np.asarray(weights / np.sum(weights))
