"""Numbers that devices write where they have no reading: -9999, 9.9e37, 32767."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rig.arrays import Array

# By size: nines as loggers fill with, the largest integers and floats, SCPI's 9.9e37 and 9.91e37, Campbell's 6999.
_NINES = [(10.0**digits - 1.0) / 10.0**behind for digits in range(3, 11) for behind in range(digits - 2)]
_WIDTHS = [2.0**bits - less for bits in (15, 16, 23, 24, 31, 32, 63, 64) for less in (0.0, 1.0)]
_OTHERS = [999.25, 6999.0, 7999.0, 9.9e37, 9.91e37, float(np.finfo(np.float32).max), float(np.finfo(np.float64).max)]
_POWERS = [10.0**power for power in (*range(20, 39), 99, 100, 300, 307, 308)]
KNOWN = np.unique([*_NINES, *_WIDTHS, *_OTHERS, *_POWERS])
SAME = 1e-6  # relative: some are kept in single precision
MIN_SENTINEL_RATIO = 3.0  # times the largest of the other numbers: no reading
MIN_OTHERS = 10  # of which that is known


def sentinels(values: Array) -> Mapping[float, int]:
    """Which numbers of a column, shape (n,), stand for no reading, and how often; empty for nearly all columns.

    A number counts as one if it is known as such and lies far beyond all that are not. Where most are known, one alone
    may be: a torque that is switched between two values has two.
    """
    size = np.abs(values)
    large = np.flatnonzero(np.isfinite(values) & (size >= (1.0 - SAME) * KNOWN[0]))
    if not len(large):
        return {}
    nearest = np.clip(np.searchsorted(KNOWN, size[large]), 1, len(KNOWN) - 1)
    known = np.zeros(len(large), dtype=bool)
    for at in (nearest - 1, nearest):
        known |= np.isclose(size[large] / KNOWN[at], 1.0, rtol=0.0, atol=SAME)
    others = np.isfinite(values)
    others[large[known]] = False
    is_most = np.sum(known) > np.sum(others)
    if np.sum(others) < MIN_OTHERS or (is_most and len(np.unique(values[large[known]])) > 1):
        return {}
    found = large[known][size[large[known]] / MIN_SENTINEL_RATIO > np.max(size[others])]
    return {
        float(value): int(count) for value, count in zip(*np.unique(values[found], return_counts=True), strict=True)
    }


def without(values: Array, numbers: Mapping[float, int]) -> Array:
    """The column with NaN in the place of these numbers."""
    return np.where(np.isin(values, list(numbers)), np.nan, values) if numbers else values


def in_words(numbers: Mapping[float, int]) -> str:
    """ "-9999" or "-9999 and 32767", as the file has them."""
    return " and ".join(f"{value:.6g}" for value in numbers)
