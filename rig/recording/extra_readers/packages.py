"""Whether the package that reads a format is there."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from rig.errors import RecordingError


def require(package: str, path: Path, extra: str) -> None:
    """Raise RecordingError, with the line that installs it, where the package that reads a format is missing."""
    if find_spec(package) is None:
        raise RecordingError(
            f"{path}: reading this format needs the package {package}: pip install 'isp-rig[{extra}]', or export the "
            "recording as CSV"
        )
