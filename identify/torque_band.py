"""How high the torque of a run reaches in frequency."""

from __future__ import annotations

import numpy as np

from identify.traces import UPSAMPLING, Trace

MOST = 0.999  # of the torque's power


def highest_torque_hz(trace: Trace) -> float:
    """The frequency below which nearly all of a run's torque is; infinite without a torque."""
    if trace.torque is None:
        return np.inf
    torque = trace.fine[3][::UPSAMPLING]
    power = np.cumsum(np.abs(np.fft.rfft(torque)) ** 2)
    at = int(np.searchsorted(power, MOST * power[-1]))
    return at / (len(torque) * trace.step_s)
