"""Motion in closed form, to hold integrators against."""

from __future__ import annotations

import itertools

import numpy as np
from scipy.linalg import expm

from rig.dynamics import TorqueSignal
from rig.platform import Platform


def moved_by_a_held_torque(platform: Platform, torque: TorqueSignal, time_s: np.ndarray) -> np.ndarray:
    """Rate of a platform without effects, exact: a matrix exponential from change to change and sample to sample."""
    j, c, k = platform.inertia_kg_m2, platform.damping_nm_s_rad, platform.stiffness_nm_rad
    a = np.array([[0.0, 1.0], [-k / j, -c / j]])
    instants = np.unique(np.concatenate([time_s, torque.time_s[torque.time_s < time_s[-1]]]))
    x, rates = np.zeros(2), {instants[0]: 0.0}
    for begin, end in itertools.pairwise(instants):
        rest = np.array([torque.at(np.array([0.5 * (begin + end)]))[0] / k, 0.0])
        x = rest + expm(a * (end - begin)) @ (x - rest)
        rates[end] = x[1]
    return np.array([rates[t] for t in time_s])
