"""The zero-phase low-pass that torque and motion pass alike."""

from __future__ import annotations

import numpy as np
from scipy import signal

from rig.recording.run import Array


def low_pass(values: Array, cutoff_hz: float, step_s: float) -> Array:
    """Zero-phase fourth-order Butterworth (second order run forwards and backwards)."""
    wn = 2.0 * cutoff_hz * step_s
    if wn >= 0.95:
        return values
    sos = signal.butter(2, wn, output="sos")
    return np.asarray(signal.sosfiltfilt(sos, values, padlen=min(len(values) - 1, int(6.0 / wn) + 10)))
