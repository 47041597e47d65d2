"""The zero-phase low-pass that torque and motion pass alike."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import signal

from rig.recording.run import Array

EDGE_PERIODS = 3.0  # of the cut-off: so much at either end of a run the filter has not settled


@lru_cache(maxsize=64)
def _sections(wn: float) -> Array:
    """Of the filter, (1, 6), at a cut-off over Nyquist's: a search asks hundreds of times for a few of them."""
    return np.asarray(signal.butter(2, wn, output="sos"))


def low_pass(values: Array, cutoff_hz: float, step_s: float) -> Array:
    """Zero-phase fourth-order Butterworth (second order run forwards and backwards)."""
    wn = 2.0 * cutoff_hz * step_s
    if wn >= 0.95:
        return values
    return np.asarray(signal.sosfiltfilt(_sections(wn), values, padlen=min(len(values) - 1, int(6.0 / wn) + 10)))
