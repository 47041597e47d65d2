"""How high the torque of a run reaches in frequency."""

from __future__ import annotations

import numpy as np

from identify.signals.trace import UPSAMPLING, Trace
from rig.recording.run import Array

POWER_SHARE = 0.999  # of the torque's power


def highest_torque_hz(trace: Trace) -> float:
    """The frequency below which nearly all of a run's torque is; infinite without a torque."""
    if trace.torque is None:
        return np.inf
    return highest_hz(trace.fine[3][::UPSAMPLING], trace.step_s)


def highest_hz(torque_nm: Array, step_s: float) -> float:
    """The frequency below which nearly all of a sampled torque is, (n,); zero where there is none."""
    power = np.cumsum(np.abs(np.fft.rfft(torque_nm)) ** 2)
    at = int(np.searchsorted(power, POWER_SHARE * power[-1]))
    return at / (len(torque_nm) * step_s)
