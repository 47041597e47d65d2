"""What the platform is and how to play on it: configuration, model, effects, excitation, recording.

The public names are those of ``__all__``; they load when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from rig.compiled_cache import ensure_compiled_cache

if TYPE_CHECKING:
    from rig.config.load import LoadedConfig as LoadedConfig
    from rig.config.load import load_config as load_config
    from rig.dynamics import Motion as Motion
    from rig.dynamics import TorqueSignal as TorqueSignal
    from rig.dynamics import simulate as simulate
    from rig.errors import ConfigError as ConfigError
    from rig.errors import InputError as InputError
    from rig.errors import MissingPackage as MissingPackage
    from rig.errors import RecordingError as RecordingError
    from rig.errors import RigError as RigError
    from rig.platform import Platform as Platform
    from rig.recording.load import read_recording as read_recording
    from rig.recording.run import Recording as Recording
    from rig.recording.run import Run as Run

__all__ = [
    "ConfigError",
    "InputError",
    "LoadedConfig",
    "MissingPackage",
    "Motion",
    "Platform",
    "Recording",
    "RecordingError",
    "RigError",
    "Run",
    "TorqueSignal",
    "load_config",
    "read_recording",
    "simulate",
]

_HOME = {
    "ConfigError": "rig.errors",
    "InputError": "rig.errors",
    "LoadedConfig": "rig.config.load",
    "MissingPackage": "rig.errors",
    "Motion": "rig.dynamics",
    "Platform": "rig.platform",
    "Recording": "rig.recording.run",
    "RecordingError": "rig.errors",
    "RigError": "rig.errors",
    "Run": "rig.recording.run",
    "TorqueSignal": "rig.dynamics",
    "load_config": "rig.config.load",
    "read_recording": "rig.recording.load",
    "simulate": "rig.dynamics",
}

ensure_compiled_cache()  # here, because it has to come before the first kernel of any package is compiled


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
