"""Types of arrays, shared by everything that calculates."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]  # float64 in fact; numpy's annotations lose that in arithmetic
Mask = NDArray[np.bool_]
