"""Piecewise polynomials read off in compiled code: SciPy's evaluation holds up every other thread meanwhile."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline, PPoly

from rig.arrays import Array
from rig.dynamics.native import jit


class Polynomials:
    """A spline of SciPy as polynomials between its knots.

    Parameters
    ----------
    spline
        A ``BSpline`` or a ``PPoly`` (``CubicSpline`` is one).
    """

    def __init__(self, spline: BSpline | PPoly) -> None:
        if isinstance(spline, PPoly):
            self._knots = np.asarray(spline.x, dtype=np.float64)
            self._lowest_first = np.ascontiguousarray(spline.c[::-1].T)
            return
        knots = np.ascontiguousarray(spline.t, dtype=np.float64)
        weights = np.ascontiguousarray(spline.c, dtype=np.float64)
        end = len(knots) - spline.k - 1  # the knots at both ends are repeated; of a derivative, weights follow unused
        first = spline.k + np.flatnonzero(np.diff(knots[spline.k : end + 1]) > 0.0)
        self._knots = np.append(knots[first], knots[end])
        self._lowest_first = np.empty((len(first), spline.k + 1))
        _expand(knots, weights, first, self._lowest_first)

    def __call__(self, at: Array) -> Array:
        """Values at any instants, shape as given; the first and the last polynomial go on beyond the ends."""
        t = np.ascontiguousarray(at, dtype=np.float64).reshape(-1)
        out = np.empty_like(t)
        _read_off(self._knots, self._lowest_first, t, out)
        return out.reshape(np.shape(at))


@jit
def _expand(knots, weights, first, lowest_first):  # type: ignore[no-untyped-def]
    """A B-spline about the beginning of each of its pieces: de Boor's rule for the spline and every derivative."""
    order = lowest_first.shape[1]
    slopes, left = np.empty(order), np.empty(order)
    for n in range(len(first)):
        at = first[n]
        x, factorial = knots[at], 1.0
        for k in range(order):
            slopes[k] = weights[at - order + 1 + k]
        for derivative in range(order):
            degree = order - 1 - derivative
            for k in range(degree + 1):
                left[k] = slopes[k]
            for level in range(1, degree + 1):
                for k in range(degree, level - 1, -1):
                    begin = knots[at - degree + k]
                    part = (x - begin) / (knots[at + k + 1 - level] - begin)
                    left[k] = (1.0 - part) * left[k - 1] + part * left[k]
            lowest_first[n, derivative] = left[degree] / factorial
            factorial *= derivative + 1.0
            for k in range(degree):
                slopes[k] = degree * (slopes[k + 1] - slopes[k]) / (knots[at + k + 1] - knots[at - degree + 1 + k])


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
