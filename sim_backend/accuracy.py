"""Accuracy of the simulated motion: the rig as it plays, compared with the same rig on much finer steps."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array
from rig.excitation import Sine
from rig.platform import Platform
from sim_backend.plant import RATE_COLUMN, Plant

TICK_S = 1e-3


def played_rate(platform: Platform, sine: Sine, parts: int, *, held: bool = False) -> Array:
    """Rate in rad/s after every tick of 1 ms, shape (ticks,), played with ``parts`` fine steps a tick.

    ``held`` holds each tick's torque until the next instead of following the sine between them.
    """
    plant = Plant(platform, TICK_S / parts, phase_rad=np.inf)
    ticks = round(sine.duration_s / TICK_S)
    rate = np.empty(ticks)
    for k in range(ticks):
        if held:
            rows = plant.hold(float(sine.torque(k * TICK_S)), parts)
        else:
            quarter_steps = np.arange(1, 4 * parts + 1) / (4 * parts)
            rows = plant.follow(sine.torque((k + quarter_steps) * TICK_S))
        rate[k] = rows[parts - 1, RATE_COLUMN]
    return rate


def largest_error_rad_s(
    platform: Platform, sine: Sine, parts: int, reference_parts: int, *, held: bool = False
) -> float:
    """Largest difference in rate between two numbers of fine steps a tick."""
    fine = played_rate(platform, sine, reference_parts, held=held)
    return float(np.max(np.abs(played_rate(platform, sine, parts, held=held) - fine)))
