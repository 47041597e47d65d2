"""J, C and K as systems of python-control, where that is installed."""

from __future__ import annotations

from types import ModuleType
from typing import Any

from identify.model.linear_matrices import STATE_NAMES, input_name, linear_matrices
from rig.errors import MissingPackage
from rig.platform import Platform


def state_space_of(platform: Platform, inertia_unknown: bool) -> Any:
    """``control.StateSpace`` with the states angle and rate. Raises MissingPackage and InputError."""
    control, names = _control("state_space"), list(STATE_NAMES)
    return control.ss(*linear_matrices(platform), states=names, outputs=names, inputs=[input_name(inertia_unknown)])


def transfer_function_of(platform: Platform, inertia_unknown: bool) -> Any:
    """``control.TransferFunction`` from torque to angle and rate. Raises MissingPackage and InputError."""
    control = _control("transfer_function")
    a, b, _, _ = linear_matrices(platform)
    # By hand: a conversion of the state space leaves coefficients of 1e-17 where there is nothing.
    under, gain = [1.0, -a[1, 1], -a[1, 0]], b[1, 0]
    return control.tf(
        [[[gain]], [[gain, 0.0]]], [[under], [under]], outputs=list(STATE_NAMES), inputs=[input_name(inertia_unknown)]
    )  # fmt: skip


def _control(call: str) -> ModuleType:
    try:
        import control  # noqa: PLC0415  optional
    except ImportError:
        raise MissingPackage(
            f"{call} needs python-control, which is not installed: pip install 'isp-rig[notebook]'"
        ) from None
    module: ModuleType = control
    return module
