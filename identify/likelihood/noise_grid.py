"""The noise that a fit begins from: torque disturbance, walk and low-pass of the sensor, on a coarse grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from identify.likelihood.noise_bounds import NoiseBounds
from identify.model.structure import Structure
from rig import effects
from rig.dynamics.gains import Noise

INITIAL_BIAS_WALK = 1e-5  # of the rate, over a run
INITIAL_PREFILTER_NOISE = 0.1  # times the variance of one reading
WHITE_SHARES = (1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-6)  # of the torque, on the grid
COLOURED_SHARES, WHITE_BESIDE = (0.3, 0.03, 0.003), (1.0, 0.05)  # of the torque, and times the best white beside them
LITTLE_DISTURBANCE = 1e-6  # of the torque


def kinds_of_noise(bounds: NoiseBounds, structure: Structure) -> list[str]:
    """The numbers of the noise that a model has; without a low-pass nothing is ahead of it."""
    out = ["white", "slow", "time_constant_s", "smooth"]
    if bounds.gyro:
        out.append("walk")
        if any(effects.get(e).lag is not None for e in structure.effects):
            out.append("ahead")
    elif bounds.wanders:
        out += ["walk", "walk_s"]
    return out


def noise_on_grid(bounds: NoiseBounds, cost: Callable[[Noise], float], smooth: Sequence[bool]) -> Noise:
    """The best of a coarse grid of noises: white alone first, then a coloured part beside it, rough or smooth."""
    p = bounds
    times_s = np.geomspace(20.0 * p.step_s, 0.3 * p.slowest_s, 3).tolist()
    gyro = (p.walk(INITIAL_BIAS_WALK), INITIAL_PREFILTER_NOISE, np.inf if p.gyro else 30.0 * p.step_s)
    little = p.slow(LITTLE_DISTURBANCE)

    def of(white: float, coloured: float, time_s: float, is_smooth: bool = True) -> Noise:
        slow, also = (little, coloured) if is_smooth else (coloured, little)
        return p.within(Noise(white, slow, time_s, *gyro, also))

    best = min((of(p.white(share), little, times_s[1]) for share in WHITE_SHARES), key=cost)
    coloured = [
        of(best.white * w, p.slow(share), t, which)
        for which in smooth for t in times_s for share in COLOURED_SHARES for w in WHITE_BESIDE
    ]  # fmt: skip
    return min((best, *coloured), key=cost)
