"""Fewer points that look the same: peaks kept in a line, clouds sampled evenly, a mean in bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.recording.run import Array

Indices = NDArray[np.intp]


def line(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """Lowest and highest sample of each of ``points`` / 2 stretches, so that no peak is lost.

    NaN in ``y`` breaks the line: a stretch without any number is one NaN.
    """
    if len(y) <= points:
        return x, y
    first = np.linspace(0, len(y), max(1, points // 2 - 1), endpoint=False).astype(int)
    stretch = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(y))))
    known = np.isfinite(y)
    rank = np.where(known, y, np.inf)
    lowest = _first_of_each(stretch, rank == np.minimum.reduceat(rank, first)[stretch])
    rank = np.where(known, y, -np.inf)
    highest = _first_of_each(stretch, rank == np.maximum.reduceat(rank, first)[stretch])
    kept = np.concatenate([[0, len(y) - 1], lowest, highest])
    at = np.unique(kept)
    return x[at], y[at]


def _first_of_each(stretch: Indices, chosen: NDArray[np.bool_]) -> Indices:
    """Index of the first chosen sample of each stretch; where none has a number, all are chosen alike."""
    at = np.flatnonzero(chosen)
    return at[np.unique(stretch[at], return_index=True)[1]]


def cloud(x: Array, y: Array, points: int) -> tuple[Array, Array]:
    """At most ``points`` of the samples, the same ones every time; NaN left out.

    Drawn at random: a fixed stride would beat with a periodic signal.
    """
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(known) > points:
        known = np.sort(np.random.default_rng(0).choice(known, points, replace=False))
    return x[known], y[known]


def binned_mean(x: Array, y: Array, bins: int = 40) -> tuple[Array, Array]:
    """Means of ``x`` and ``y`` in bins of ``x`` of equal width; bins with too few samples left out."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if len(x) == 0 or np.ptp(x) == 0.0:
        return np.empty(0), np.empty(0)
    edges = np.linspace(x.min(), x.max(), bins + 1)
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, bins - 1)
    count = np.bincount(at, minlength=bins)
    full = count >= max(5, len(x) // 1000)
    where, mean = (np.bincount(at, weights=values, minlength=bins)[full] / count[full] for values in (x, y))
    return where, mean
