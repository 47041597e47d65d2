"""The versions of this program and of the packages it uses."""

from __future__ import annotations

from importlib import metadata


def version() -> str:
    """The version of this program as installed, or "unknown" where it runs from bare sources."""
    return version_of("isp-rig")


def version_of(package: str) -> str:
    """The version of an installed package, or "unknown"."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"
