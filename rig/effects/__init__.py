"""Every effect the product knows, one file each; a new one is a new file and a line in ``_MODULES``."""

from __future__ import annotations

from functools import cache
from importlib import import_module

from rig.effects.base import Effect, Parameter, Place, Scale

_MODULES = {
    "coulomb_friction": "coulomb",
    "stribeck_friction": "stribeck",
    "presliding_friction": "presliding",
    "load_dependent_friction": "load_dependent",
    "quadratic_damping": "quadratic_damping",
    "directional_damping": "directional_damping",
    "cubic_stiffness": "cubic_stiffness",
    "quadratic_stiffness": "quadratic_stiffness",
    "bilinear_stiffness": "bilinear_stiffness",
    "backlash": "backlash",
    "hysteresis": "hysteresis",
    "creep": "creep",
    "stiffness_drift": "stiffness_drift",
    "unbalance": "unbalance",
    "cogging": "cogging",
    "torque_delay": "torque_delay",
    "actuator_lag": "actuator_lag",
    "torque_saturation": "torque_saturation",
    "torque_deadzone": "torque_deadzone",
    "torque_offset": "torque_offset",
    "flexible_mode": "flexible_mode",
    "sensor_lag": "sensor_lag",
    "rate_bias": "rate_bias",
    "periodic_disturbance": "periodic_disturbance",
}


def names() -> tuple[str, ...]:
    """Names of all effects, in the order of the docs."""
    return tuple(_MODULES)


@cache
def get(name: str) -> Effect:
    """The effect of that name; its module is loaded when first asked for.

    Raises
    ------
    KeyError
        Where no effect has that name.
    """
    effect: Effect = import_module(f"rig.effects.{_MODULES[name]}").EFFECT
    return effect


__all__ = ["Effect", "Parameter", "Place", "Scale", "get", "names"]
