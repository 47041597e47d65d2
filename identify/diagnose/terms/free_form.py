"""A free-form term that may stand beside a model in torque, and the splines that such terms are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from rig.arrays import Array

SPLINE_KNOTS = 7  # inner knots of a spline, at even shares of the samples
SHAPE_POINTS = 25  # places at which a curve's shape is given


@dataclass(frozen=True)
class FreeForm:
    """A free-form term: its columns at every sample, and where its shape is shown."""

    on: str
    columns: Array  # (n, k)
    at: Array
    shape: Array  # (SHAPE_POINTS, k)
    of_each_run: bool = False  # columns that belong to one run each
    wave_on: str = ""
    wave_hz: float | None = None
    changes: str = ""
    noise_nm: Callable[[], float] | None = None  # what it makes of noise, where that is not its fit to noise alone


def free_splines(x: Array) -> tuple[Callable[[Array], Array] | None, Array]:
    """Splines with knots at even shares of the values, and places at which to show them; None of too few values."""
    inner = np.unique(np.quantile(x, np.linspace(0.0, 1.0, SPLINE_KNOTS + 2)))
    if len(inner) < 4:
        return None, np.zeros(0)
    knots = np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])

    def basis(values: Array) -> Array:
        return np.asarray(BSpline.design_matrix(np.clip(values, inner[0], inner[-1]), knots, 3).toarray())

    def straight(values: Array) -> Array:
        return np.column_stack([np.ones(len(values)), values])

    columns = basis(x)
    line = np.linalg.lstsq(straight(x), columns, rcond=None)[0]
    _, s, v = np.linalg.svd(columns - straight(x) @ line, full_matrices=False)
    kept = v[s > 1e-6 * s[0]].T
    at = np.linspace(inner[0], inner[-1], SHAPE_POINTS)
    return lambda values: (basis(values) - straight(values) @ line) @ kept, at
