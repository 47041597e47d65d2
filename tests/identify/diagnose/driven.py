"""Runs of a platform whose drive makes another torque of what it is asked for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rig.arrays import Array
from rig.recording.run import Run
from tests.identify.simulated import NOISE_RAD_S, TRUTH

TONES_HZ, DURATION_S, STEP_S = (0.6, 1.7, 4.3, 7.9), 10.0, 0.5e-3


def run_driven(drive: Callable[[Array], Array], number: int) -> Run:
    """Bursts of a multisine, read at 1 kHz; ``drive`` makes of the torque in steps of ``STEP_S`` what acts."""
    j, c, k = TRUTH
    t = np.arange(round(DURATION_S / STEP_S) + 1) * STEP_S
    burst = 0.3 + 0.7 * (np.sin(2 * np.pi * 0.21 * t + 2.0 * number) > 0.0)
    asked = 30.0 * burst * sum(np.sin(2 * np.pi * f * t + 1.3 * i + number) for i, f in enumerate(TONES_HZ))
    torque = drive(asked)
    angle = rate = 0.0
    rates = np.zeros(len(t))
    for n in range(len(t) - 1):  # symplectic, two steps each
        middle = 0.5 * (torque[n] + torque[n + 1])
        for _ in range(2):
            rate += 0.5 * STEP_S * (middle - c * rate - k * angle) / j
            angle += 0.5 * STEP_S * rate
        rates[n + 1] = rate
    time = t[::2]
    read = rates[::2] + NOISE_RAD_S * np.random.default_rng(number).standard_normal(len(time))
    return Run(
        f"run {number}", time, np.ones(len(time), bool), rate_rad_s=read, torque_time_s=time, torque_nm=asked[::2]
    )
