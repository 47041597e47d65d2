"""Piecewise polynomials read off in compiled code: SciPy's evaluation holds up every other thread meanwhile."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.interpolate import PPoly

from rig.arrays import Array
from rig.dynamics.native import jit


class Polynomials:
    """A spline of SciPy as polynomials between its knots.

    Parameters
    ----------
    spline
        A ``BSpline`` or a ``PPoly`` (``CubicSpline`` is one).
    """

    def __init__(self, spline: Any) -> None:
        pieces = spline if isinstance(spline, PPoly) else PPoly.from_spline(spline)
        wide = np.diff(pieces.x) > 0.0  # the knots at the ends of a B-spline are repeated
        self._knots = np.append(pieces.x[:-1][wide], pieces.x[-1])
        self._lowest_first = np.ascontiguousarray(pieces.c[::-1, wide].T)

    def __call__(self, at: Array) -> Array:
        """Values at any instants, shape as given; the first and the last polynomial go on beyond the ends."""
        t = np.ascontiguousarray(at, dtype=np.float64).reshape(-1)
        out = np.empty_like(t)
        _read_off(self._knots, self._lowest_first, t, out)
        return out.reshape(np.shape(at))


@jit
def _read_off(knots, lowest_first, at, out):  # type: ignore[no-untyped-def]
    """Horner's rule; instants in order cost no search."""
    last, order = len(knots) - 2, lowest_first.shape[1]
    i = 0
    for n in range(len(at)):
        t = at[n]
        if t < knots[i] or (i < last and t >= knots[i + 1]):
            if i < last and t >= knots[i + 1] and (i + 1 == last or t < knots[i + 2]):
                i += 1
            else:
                i = min(max(np.searchsorted(knots, t, "right") - 1, 0), last)
        x, value = t - knots[i], 0.0
        for k in range(order - 1, -1, -1):
            value = value * x + lowest_first[i, k]
        out[n] = value
