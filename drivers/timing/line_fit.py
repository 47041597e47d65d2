"""Straight lines through clock readings, of which some are late and a few are wrong."""

from __future__ import annotations

import numpy as np

from rig.arrays import Array

DRIFT_LIMIT = 1e-3  # s/s: ten times the worst crystal
TRIMS = 2  # rounds of leaving out
# A block so little below the median always stays; a wrong one shifts the line by at most this, 0.03 of a 1 ms sample.
# Calibration: tests/drivers/timing holds from 30 to 1000 us; at 10 us good blocks of a 200 Hz gyro are left out, and
# its line moves by more than 6 us.
TRIM_FLOOR_S = 30e-6
TRIM_DEVIATIONS = 4.0  # below the median: blocks in which a latency was misreported
LOWER_SHARE = 0.5  # of the blocks: the others are late, because the host was busy or had to wake up first
MIDDLE_TRIMS = 4  # rounds of leaving out
# A reading so close to the median always stays, so that the resolution of a drive's time stamps (1 us, 0x1013) leaves
# out none. Not critical: tests/drivers/timing holds from 0 to 100 us.
MIDDLE_FLOOR_S = 5e-6
MIDDLE_DEVIATIONS = 2.5  # of the median distance: 1.7 standard deviations of normal scatter


def _half_span_slope(x: Array, y: Array) -> float:
    """Median slope across half the span: a start that a few outliers cannot pull."""
    half = len(x) // 2
    return float(np.median((y[len(x) - half :] - y[:half]) / (x[len(x) - half :] - x[:half])))


def _least_squares(x: Array, y: Array) -> tuple[float, float]:
    """Slope, within what a clock may drift, and value at x = 0."""
    mean_x, mean_y = float(x.mean()), float(y.mean())
    centred = x - mean_x
    slope = float(centred @ (y - mean_y)) / max(float(centred @ centred), 1e-12)
    slope = max(-DRIFT_LIMIT, min(DRIFT_LIMIT, slope))
    return slope, mean_y - slope * mean_x


def lower_line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and value at x = 0 of the line through the lower half of points that can only be too high.

    Parameters
    ----------
    x, y
        Shape (n,), seconds; n of six or more.
    """
    slope, level = _half_span_slope(x, y), 0.0
    lower = int(LOWER_SHARE * (len(x) - 1))
    for _ in range(TRIMS):
        residual = y - slope * x
        middle = float(np.median(residual))
        spread = float(np.median(np.abs(residual - middle)))
        low = middle - max(TRIM_FLOOR_S, TRIM_DEVIATIONS * spread)
        use = (residual >= low) & (residual <= np.partition(residual, lower)[lower])
        slope, level = _least_squares(x[use], y[use])
    return slope, level


def middle_line(x: Array, y: Array) -> tuple[float, float]:
    """Slope and value at x = 0 of the line through points that scatter to both sides, outliers left out.

    Parameters
    ----------
    x, y
        Shape (n,), seconds; n of six or more.
    """
    slope, level = _half_span_slope(x, y), 0.0
    for _ in range(MIDDLE_TRIMS):
        residual = y - slope * x
        distance = np.abs(residual - float(np.median(residual)))
        use = distance <= max(MIDDLE_FLOOR_S, MIDDLE_DEVIATIONS * float(np.median(distance)))
        slope, level = _least_squares(x[use], y[use])
    return slope, level
