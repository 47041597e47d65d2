"""Calls every function of the loop once before torque is possible, so that none is loaded or compiled later.

The first call of a numeric routine loads code from disk and allocates: with locked memory the first matrix product
alone pages in 32 MB, which took 15 ms on one machine and 110 ms on another. In the loop that is a stall, and a stall
is a trip, so it has to happen before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rig.excitation import PlannedSet
from rig.guard import Guard
from rig.guard.base import Rest, Tick
from rig.interface import GyroSample, TorqueSample
from rig.platform import Platform
from rig.sequencer.pulse_inertia import estimate_inertia

LENGTH_S = 0.5  # every check has given a verdict by then
FREQUENCY_HZ = 5.0  # any frequency serves: nothing is judged here
ANGLE_RAD = 1e-5  # far below every limit
PULSE_S = 0.05  # within the lengths that a probe plays (0.01 to 0.1 s)


def warm_up(guard: Guard, platform: Platform, sets: Sequence[PlannedSet], sample_rate_hz: float) -> None:
    """Show a guard half a second of an easy motion, and the probe's arithmetic one pulse.

    Parameters
    ----------
    guard
        One to throw away: it remembers what it saw, and whatever it says is not heard.
    sets
        What is going to be played: each is asked for its torque once.
    """
    j, c, k = platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad
    omega, period_s = 2.0 * math.pi * FREQUENCY_HZ, 1.0 / sample_rate_hz
    guard.begin(0.0, Rest())
    for i in range(1, math.ceil(LENGTH_S * sample_rate_hz)):
        now_s = i * period_s
        along, across = ANGLE_RAD * math.sin(omega * now_s), ANGLE_RAD * math.cos(omega * now_s)
        torque_nm = (k - j * omega**2) * along + c * omega * across
        gyro, torque = (GyroSample(now_s, omega * across, True),), (TorqueSample(now_s, torque_nm),)
        guard.permit(torque_nm, now_s, 0.0)
        guard.look(Tick(now_s, 0.0, period_s, torque_nm, gyro, torque, {}))
    for planned in sets:
        planned.torque(0.0)
    time_s = np.linspace(0.0, PULSE_S, 100)
    estimate_inertia(time_s, PULSE_S / math.pi * (1.0 - np.cos(math.pi * time_s / PULSE_S)), 1.0, PULSE_S)
