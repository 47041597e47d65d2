"""What a recording has to say about its origin, so that it can be understood years later."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from importlib import metadata
from typing import Any

from rig.config.load import LoadedConfig

PACKAGES = ("isp-rig", "numpy", "scipy", "numba", "h5py", "pyserial", "python-can", "canopen")


def version() -> str:
    """The version of this program as installed, or "unknown" where it runs from bare sources."""
    return _version_of("isp-rig")


def _version_of(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def provenance(loaded: LoadedConfig) -> dict[str, Any]:
    """When, by which versions, from which configuration: as understood, and as read with its overrides."""
    return {
        "started_utc": datetime.now(UTC).isoformat(),
        "config_file": str(loaded.path),
        "config": loaded.config.model_dump(mode="json"),
        "config_text": loaded.text,
        "config_included": dict(loaded.included),
        "config_overrides": list(loaded.overrides),
        "versions": {name: _version_of(name) for name in PACKAGES} | {"python": platform.python_version()},
        "system": platform.platform(),
    }
