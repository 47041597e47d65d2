"""Measured rows made into a Run: sorted by time, slow channels on the grid of the samples."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rig.arrays import Array


def increasing(rows: Array) -> Array:
    """Rows, shape (n, columns), whose first column is later than that of every row before.

    A device that repeats itself, or whose clock is set back, must not spoil the record.
    """
    if len(rows) < 2:
        return rows
    newest = np.maximum.accumulate(rows[:, 0])
    return rows[np.concatenate([[True], rows[1:, 0] > newest[:-1]])]


def on_samples(ticks: Array, names: Sequence[str], first: int, time_s: Array) -> dict[str, Array]:
    """Channels that were read once a tick, at the times of the samples.

    Parameters
    ----------
    ticks
        Shape (n, columns): time in the first column, the channels ``names`` from column ``first`` on.
    """
    return {name: np.interp(time_s, ticks[:, 0], ticks[:, first + i]) for i, name in enumerate(names)}
