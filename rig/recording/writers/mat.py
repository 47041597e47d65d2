"""MATLAB's .mat, version 5: a column vector a quantity."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import cast

from scipy.io import savemat

from rig.arrays import Array


def write(path: Path, columns: Mapping[str, Array]) -> None:
    """Write the vectors. Raises OSError, FileExistsError among them."""
    with path.open("xb") as file:
        # The stubs ask for a name; an open file is what makes sure that nothing is overwritten.
        savemat(cast(str, file), dict(columns), long_field_names=True, do_compression=True, oned_as="column")
