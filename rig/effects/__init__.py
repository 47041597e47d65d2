"""Every effect the product knows, one file each; a new one is a new file and a line in ``_MODULES``.

Effects from outside the package (installed ones, and files that a rig.yaml names) stand behind them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path

from rig.channels import Channel
from rig.effects import _channels, _outside
from rig.effects.base import Effect, Parameter, Place, Scale, filter_kernel, kernel

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
    "torque_scale": "torque_scale",
    "flexible_mode": "flexible_mode",
    "sensor_lag": "sensor_lag",
    "rate_bias": "rate_bias",
    "periodic_disturbance": "periodic_disturbance",
}

# A motor has several: each further order of the same torque is an effect of its own, which no list shows.
_FURTHER = {f"cogging_{k}": "cogging" for k in range(2, 7)}
# The same effect in another form, which competes with the first and goes by its name.
_FORMS = {"sensor_lag_second_order": "sensor_lag"}


def names() -> tuple[str, ...]:
    """Names of all effects, in the order of the docs, those from outside the package last; none of channels."""
    return (*_MODULES, *_outside.names(_MODULES))


def known() -> tuple[str, ...]:
    """Those names, and behind them the effects of measured channels that were declared."""
    return (*names(), *_channels.names())


def exists(name: str) -> bool:
    """Whether a model may hold an effect of that name: a known one, one more of it, or another form of it."""
    return name in known() or name in _FURTHER or name in _FORMS


def get(name: str) -> Effect:
    """The effect of that name; its module is loaded when first asked for.

    Raises
    ------
    KeyError
        Where no effect has that name.
    ConfigError
        Where it comes from an installed package and cannot be loaded.
    """
    if name in _MODULES:
        return _own(name)
    if name in _FURTHER:
        return _further(name)
    if name in _FORMS:
        return _form(name)
    if name.startswith("free_") and name in free_forms():
        return free_forms()[name]
    return _channels.get(name) if name in _channels.names() else _outside.get(name)


@cache
def _own(name: str) -> Effect:
    effect: Effect = import_module(f"rig.effects.{_MODULES[name]}").EFFECT
    return effect


@cache
def _further(name: str) -> Effect:
    return replace(_own(_FURTHER[name]), name=name)


@cache
def _form(name: str) -> Effect:
    effect: Effect = import_module(f"rig.effects.{name}").EFFECT
    return effect


def free_forms() -> Mapping[str, Effect]:
    """The curves that show what no effect describes, by name; loaded when first asked for."""
    from rig.effects._free_form import FREE_FORMS  # noqa: PLC0415  compiled kernels: a simulation needs none of them

    return FREE_FORMS


def forms(name: str) -> tuple[str, ...]:
    """The other forms of an effect, which go by its name; none of most."""
    return tuple(form for form, first in _FORMS.items() if first == name)


def further(name: str) -> tuple[str, ...]:
    """The effects that are more of the same, in the order in which they are added; empty for most."""
    return tuple(more for more, first in _FURTHER.items() if first == name)


def first_of(name: str) -> str:
    """The effect that an effect is more of, or another form of; itself for most."""
    return {**_FURTHER, **_FORMS}.get(name, name)


def read_file(path: Path) -> str:
    """Make the effects of a Python file known (it is run). Returns its text.

    Raises
    ------
    ConfigError
        Where it holds no effect that works; the message says the file, the line and the cure.
    """
    return _outside.read_file(path, _MODULES)


def declare_channels(channels: Iterable[Channel]) -> None:
    """Make the effects of measured channels known, each named <channel>_<way>.

    They replace those of channels of the same name that were declared before.

    Raises
    ------
    ConfigError
        Where such a name is taken.
    """
    _channels.declare(channels, lambda name: name in _MODULES or name in _outside.names(_MODULES))


def of_channel(name: str) -> tuple[str, ...]:
    """The effects that a declared channel makes."""
    return tuple(n for n in _channels.names() if (read := _channels.get(n).reads) is not None and read.name == name)


def file_of(name: str) -> Path | None:
    """The file that an effect was read from; None for those of the package and of installed ones."""
    return _outside.file_of(name)


__all__ = [
    "Effect", "Parameter", "Place", "Scale", "declare_channels", "exists", "file_of", "filter_kernel",
    "first_of", "forms", "free_forms", "further", "get", "kernel", "known", "names", "of_channel", "read_file",
]  # fmt: skip
