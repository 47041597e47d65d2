"""What the estimates of a frequency response share: records, responses, coherence without its bias, excited lines.

Units are SI; "rate" stands for speed on a linear axis and "torque" for force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from rig.recording.run import Array

Complex = NDArray[np.complexfloating[Any, Any]]
MIN_COHERENCE = 0.8  # coherence below which a line is drawn pale
MAX_GAIN_ERROR = 0.25  # relative error of the gain (2 dB) above which it is drawn pale as well
EXCITED = 1e-4  # of the strongest line's power (-40 dB): what lies below is not excited
MAX_RESPONSE_LINES = 240  # lines of one response
SPARSE = 0.5  # share of the bins of a band below which its lines stand apart


@dataclass(frozen=True)
class Record:
    """Torque and motion of one run on one uniform grid.

    Attributes
    ----------
    torque_nm, motion
        Shape (n,): torque in N m, and rate in rad/s, or angle in rad where ``of_angle``.
    hold_s
        How long the drive holds each value of the torque; 0 for a torque that is band-limited.
    """

    torque_nm: Array
    motion: Array
    step_s: float
    hold_s: float = 0.0
    of_angle: bool = False


@dataclass(frozen=True)
class Response:
    """A measured response, rate over torque in (rad/s)/(N m), at m frequencies.

    Attributes
    ----------
    frequency_hz, response, coherence, relative_error
        Shape (m,). Coherence is corrected for its bias and lies between 0 and 1. ``relative_error`` is one standard
        error of the gain over the gain, and of the phase in rad.
    averages
        Shape (m,): independent estimates behind each line.
    method
        How it was estimated.
    """

    frequency_hz: Array
    response: Complex
    coherence: Array
    relative_error: Array
    averages: Array
    method: Literal["whole periods", "segments", "local polynomial"]

    @property
    def gain_db(self) -> Array:
        """20 log10 of the gain over 1 (rad/s)/(N m), shape (m,)."""
        return decibel(self.response)

    @property
    def phase_deg(self) -> Array:
        """Phase of the rate against the torque, -180 to 180 deg, shape (m,)."""
        return np.degrees(np.angle(self.response))

    @property
    def trusted(self) -> NDArray[np.bool_]:
        """Lines whose coherence reaches ``MIN_COHERENCE`` and whose error is below ``MAX_GAIN_ERROR``, shape (m,)."""
        return np.asarray((self.coherence >= MIN_COHERENCE) & (self.relative_error <= MAX_GAIN_ERROR))


def decibel(response: Complex) -> Array:
    """20 log10 |response|, shape as given."""
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(response), 1e-300)))


def coherence_over_periods(plain: Array, averages: Array) -> Array:
    """Coherence without the bias of few averages, for a torque that is the same in each; zero where there is but one.

    With n periods the residual of the fitted line has n - 1 degrees of freedom and the motion n: the ratio of the
    two mean squares, and not of the sums, is what the plain estimate 1 - residual / motion ought to hold.
    """
    n = np.maximum(averages, 1.0 + 1e-9)
    return np.where(averages > 1.0 + 1e-6, np.clip((n * plain - 1.0) / (n - 1.0), 0.0, 1.0), 0.0)


def coherence_over_segments(plain: Array, averages: Array) -> Array:
    """The same for a torque like noise: c from plain = c + (1 - c)^2 / n (Bendat & Piersol, section 9.2)."""
    n = np.maximum(averages, 2.0 + 1e-9)
    half = 1.0 - 2.0 / n
    root = np.sqrt(np.maximum(half**2 + 4.0 / n * (plain - 1.0 / n), 0.0))
    return np.where(averages > 2.0, np.clip(0.5 * n * (root - half), 0.0, 1.0), 0.0)


def relative_error_of(coherence: Array, averages: Array) -> Array:
    """One standard error of the gain over the gain: sqrt((1 - c) / (2 n c)) (Bendat & Piersol, Tab. 9.6)."""
    return np.sqrt((1.0 - coherence) / np.maximum(2.0 * averages * coherence, 1e-300))


def chosen(frequency_hz: Array, power: Array) -> NDArray[np.int_]:
    """Excited lines above zero, at most ``MAX_RESPONSE_LINES`` of them, evenly over the logarithm of frequency."""
    inside = frequency_hz > 0.0
    at = np.flatnonzero(inside & (power > EXCITED * np.max(power, where=inside, initial=0.0)))
    if len(at) <= MAX_RESPONSE_LINES:
        return at
    wanted = np.geomspace(frequency_hz[at[0]], frequency_hz[at[-1]], MAX_RESPONSE_LINES)
    return np.unique(at[np.clip(np.searchsorted(frequency_hz[at], wanted), 0, len(at) - 1)])


def stands_apart(torque: Array) -> bool:
    """Whether few of the bins between the lowest and the highest excited one hold any power."""
    on = np.flatnonzero(excited(torque, signal.windows.hann(len(torque), sym=False)))
    return bool(len(on) < SPARSE * (on[-1] - on[0] + 1))


def excited(torque: Array, window: Array) -> NDArray[np.bool_]:
    """Bins that hold any of the torque's power."""
    power = np.abs(fft.rfft((torque - np.mean(torque)) * window)) ** 2
    return np.asarray(power > EXCITED * np.max(power))
