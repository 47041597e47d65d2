"""Low-passes of a sensor as the predictor follows them: exact along a cubic, however long a step is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.arrays import Array

CHORDS = 8  # straight pieces in a step within which dry friction stops the platform
EQUAL_POLES = 1e-9  # relative distance of two poles, below which they are moved apart by as much


def lag_table(lags: Sequence[tuple[float, float]], step_s: float) -> Array:
    """Every low-pass 1 / (1 + a s + b s^2) as the compiled predictor takes it, shape (n, 10).

    A row holds a and b, then what a step leaves of output and slope (2 x 2, by rows), and what one of ``CHORDS`` parts
    of a step leaves of them. One of first order (b zero) has no slope of its own.
    """
    rows = [[a, b, *_transition(a, b, step_s), *_transition(a, b, step_s / CHORDS)] for a, b in lags]
    return np.array(rows, dtype=float).reshape(-1, 10)


def _transition(a: float, b: float, step_s: float) -> tuple[float, float, float, float]:
    """What a step leaves of output and slope."""
    if b <= 0.0:
        return (float(np.exp(-step_s / a)) if a > 0.0 else 0.0), 0.0, 0.0, 0.0
    root = np.sqrt(complex(a * a - 4.0 * b))
    if abs(root) < EQUAL_POLES * a:
        root = complex(EQUAL_POLES * a)
    one, other = (-a + root) / (2.0 * b), (-a - root) / (2.0 * b)
    e_one, e_other = np.exp(one * step_s), np.exp(other * step_s)
    apart = one - other
    by_slope = ((e_one - e_other) / apart).real
    return (
        float(((one * e_other - other * e_one) / apart).real), float(by_slope),
        float(-by_slope / b), float(((one * e_one - other * e_other) / apart).real),
    )  # fmt: skip
