"""Where the captured packets lie, and how a test says that they are missing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

WIRE = Path(__file__).resolve().parents[2].parent / "shared" / "wire"

needs_captures = pytest.mark.skipif(
    not WIRE.is_dir(), reason=f"captured packets are not on this machine: {WIRE} is missing"
)


def vectors(device: str) -> list[dict[str, Any]]:
    """Captured packets whose device name starts like this; none where the captures are missing."""
    if not WIRE.is_dir():
        return []
    rows = json.loads((WIRE / "vectors.json").read_text())["vectors"]
    return [row for row in rows if row["device"].startswith(device)]
