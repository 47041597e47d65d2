"""The origin of a recording: versions, system, configuration."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from typing import Any

from commands.terminal.version import version_of
from rig.config.load import LoadedConfig

PACKAGES = ("isp-rig", "numpy", "scipy", "numba", "h5py", "pyserial", "python-can", "canopen")


def provenance(loaded: LoadedConfig) -> dict[str, Any]:
    """When, by which versions, from which configuration: as understood, and as read with its overrides."""
    return {
        "started_utc": datetime.now(UTC).isoformat(),
        "config_file": str(loaded.path),
        "config": loaded.config.model_dump(mode="json"),
        "config_text": loaded.text,
        "config_included": dict(loaded.included),
        "config_overrides": list(loaded.overrides),
        "versions": {name: version_of(name) for name in PACKAGES} | {"python": platform.python_version()},
        "system": platform.platform(),
    }
