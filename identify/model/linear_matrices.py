"""J, C and K as matrices: x' = A x + B u, y = C x + D u, with the states angle and rate."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.arrays import Array
from rig.errors import InputError
from rig.platform import Platform

STATE_NAMES = ("angle_rad", "rate_rad_s")  # which are the outputs, too


class LinearMatrices(NamedTuple):
    """The four of a state space."""

    a: Array
    b: Array
    c: Array
    d: Array


def input_name(per_inertia: bool) -> str:
    """What goes in: a torque, or where only ratios to the inertia are known the torque over it."""
    return "torque_over_inertia_rad_s2" if per_inertia else "torque_nm"


def linear_matrices(platform: Platform) -> LinearMatrices:
    """The platform without its effects, of which most have no linear response. Raises InputError."""
    inertia = platform.inertia_kg_m2
    if not inertia > 0.0:
        raise InputError(f"the final model has an inertia of {inertia:g}: a state space needs a positive one")
    a = np.array([[0.0, 1.0], [-platform.stiffness_nm_rad / inertia, -platform.damping_nm_s_rad / inertia]])
    return LinearMatrices(a, np.array([[0.0], [1.0 / inertia]]), np.eye(2), np.zeros((2, 1)))
