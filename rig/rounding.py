"""Numbers that are printed as allowed have to be allowed."""

from __future__ import annotations

import math


def rounded_down(value: float) -> str:
    """Four digits that do not exceed a value, or zero: a torque that is printed as the largest must itself pass."""
    if not 0.0 < value < math.inf:
        return "0" if value <= 0.0 else str(value)
    digits = max(0, 3 - math.floor(math.log10(value)))
    return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"
