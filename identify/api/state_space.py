"""J, C and K as a system of python-control, where that is installed."""

from __future__ import annotations

from typing import Any

import numpy as np

from rig.errors import InputError, MissingPackage
from rig.platform import Platform


def state_space_of(platform: Platform, inertia_unknown: bool) -> Any:
    """``control.StateSpace`` with the states angle and rate. Raises MissingPackage and InputError."""
    try:
        import control  # noqa: PLC0415  optional
    except ImportError:
        raise MissingPackage(
            "state_space needs python-control, which is not installed: pip install 'isp-rig[notebook]'"
        ) from None
    inertia = platform.inertia_kg_m2
    if not inertia > 0.0:
        raise InputError(f"the final model has an inertia of {inertia:g}: a state space needs a positive one")
    a = np.array([[0.0, 1.0], [-platform.stiffness_nm_rad / inertia, -platform.damping_nm_s_rad / inertia]])
    b = np.array([[0.0], [1.0 / inertia]])
    names = ["angle_rad", "rate_rad_s"]
    push = "torque_over_inertia_rad_s2" if inertia_unknown else "torque_nm"
    return control.ss(a, b, np.eye(2), np.zeros((2, 1)), states=names, outputs=names, inputs=[push])
