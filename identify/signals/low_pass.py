"""The zero-phase low-pass that torque and motion pass alike."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from rig.recording.run import Array

EDGE_PERIODS = 3.0  # of the cut-off: so much at either end of a run the filter has not settled


@lru_cache(maxsize=64)
def _sections(wn: float) -> Array:
    """Of the filter, (1, 6), at a cut-off over Nyquist's: a search asks hundreds of times for a few of them."""
    return np.asarray(signal.butter(2, wn, output="sos"))


def clear_of_ends(n: int, step_s: float, cutoff_hz: float | None) -> NDArray[np.bool_]:
    """Samples of a run of ``n`` at which the low-pass has settled, (n,): not those at its ends.

    Of a run so short that this would be most of it the middle half stays. All of it where there is no low-pass.
    """
    out = np.ones(n, dtype=bool)
    if cutoff_hz:
        edge = min(int(np.ceil(EDGE_PERIODS / (cutoff_hz * step_s))), n // 4)
        out[:edge] = out[n - edge :] = False
    return out


def low_pass(values: Array, cutoff_hz: float, step_s: float) -> Array:
    """Zero-phase fourth-order Butterworth (second order run forwards and backwards)."""
    wn = 2.0 * cutoff_hz * step_s
    if wn >= 0.95:
        return values
    return np.asarray(signal.sosfiltfilt(_sections(wn), values, padlen=min(len(values) - 1, int(6.0 / wn) + 10)))
