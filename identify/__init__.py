"""Reads recordings, estimates the platform's parameters and names what the model is missing.

The public names are those of ``__all__``; docs/from-python.md shows them at work. They load when they are first used,
so that importing this package costs nothing.

    from identify import identify

    result = identify(time_s, torque_nm, rate_rad_s=rate_rad_s)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identify.api.call import identify as identify
    from identify.api.result import Result as Result
    from identify.residual import Disturbance as Disturbance
    from identify.results import ParameterEstimate as ParameterEstimate
    from rig.errors import InputError as InputError
    from rig.errors import MissingPackage as MissingPackage

__all__ = ["Disturbance", "InputError", "MissingPackage", "ParameterEstimate", "Result", "identify"]

_HOME = {
    "Disturbance": "identify.residual",
    "InputError": "rig.errors",
    "MissingPackage": "rig.errors",
    "ParameterEstimate": "identify.results",
    "Result": "identify.api.result",
    "identify": "identify.api.call",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
