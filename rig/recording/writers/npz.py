"""NumPy's .npz: an array a quantity."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.arrays import Array


def write(path: Path, columns: Mapping[str, Array]) -> None:
    """Write the arrays. Raises OSError, FileExistsError among them."""
    arrays: dict[str, Any] = dict(columns)
    with path.open("xb") as file:
        np.savez_compressed(file, **arrays)
