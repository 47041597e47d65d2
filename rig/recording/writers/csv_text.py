"""CSV: a header, commas, decimal points, every digit of every number; what is not there is empty."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rig.arrays import Array

WRITTEN_ROWS = 10_000


def write(path: Path, columns: Mapping[str, Array]) -> None:
    """Write a table. Raises OSError, FileExistsError among them."""
    table = np.column_stack(list(columns.values()))
    with path.open("x", encoding="ascii", newline="\n") as file:
        file.write(",".join(columns) + "\n")
        for start in range(0, len(table), WRITTEN_ROWS):
            rows = table[start : start + WRITTEN_ROWS].tolist()
            file.writelines(",".join("" if math.isnan(v) else repr(v) for v in row) + "\n" for row in rows)
