"""A free-form term that may stand beside a model in torque, and the splines that such terms are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from rig.arrays import Array

SPLINE_KNOTS = 7  # inner knots of a spline, at even shares of the samples
SMOOTH_KNOTS = 60  # of a smoothing spline, at even distances: what smooths it is not how few they are
# Penalties on the squared bend of a smoothing spline between its knots, each tried: the power of what a model leaves
# over that of such a bend, from as rough as the knots allow to nearly straight.
ROUGHNESS_PENALTIES = (1e-3, 0.1, 10.0, 1e3)
CURVE_RIDGE = 1e-9  # of their own size, on the gains of free-form columns: two of them may be alike
SHAPE_POINTS = 25  # places at which a curve's shape is given
SMOOTH_SHAPE_POINTS = 4 * SHAPE_POINTS  # the same of a smoothing spline


@dataclass(frozen=True)
class FreeForm:
    """A free-form term: its columns at every sample, and where its shape is shown.

    Attributes
    ----------
    over
        Of a curve, the quantity at every sample, (n,): about values that it has not seen it says nothing.
    rough
        Of a smoothing spline, the columns, (k,) boolean, whose squared gains are how rough it is.
    """

    on: str
    columns: Array  # (n, k)
    at: Array
    shape: Array  # (SHAPE_POINTS, k)
    of_each_run: bool = False  # columns that belong to one run each
    wave_on: str = ""
    wave_hz: float | None = None
    step_nm: float | None = None  # over which it repeats along the torque
    changes: str = ""
    noise_nm: Callable[[], float] | None = None  # what it makes of noise, where that is not its fit to noise alone
    over: Array | None = None
    rough: NDArray[np.bool_] | None = None

    @property
    def penalties(self) -> tuple[float, ...]:
        """The penalties on its roughness that are to be tried; one of zero where it has none."""
        return (0.0,) if self.rough is None else ROUGHNESS_PENALTIES

    def ridge(self, roughness_penalty: float) -> Array:
        """What is added to the diagonal of the normal equations of its gains, (k,)."""
        alike = CURVE_RIDGE * float(np.mean(np.sum(self.columns**2, axis=0))) if self.columns.size else 0.0
        return alike + roughness_penalty * (0.0 if self.rough is None else self.rough) + np.zeros(self.columns.shape[1])

    def without_columns(self) -> FreeForm:
        """Nothing beside a model, held out alike."""
        return replace(self, columns=self.columns[:, :0], over=None, rough=None)


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


def smooth_splines(x: Array) -> tuple[Callable[[Array], Array] | None, Array]:
    """A smoothing spline without its line, and places at which to show it; None of values that are all alike.

    Its columns are such that the sum of the squared gains is that of the bends between the knots (Eilers and Marx 1996,
    with the penalty made diagonal): the penalty on it, and not the number of knots, decides how fine it is.
    """
    low, high = float(np.min(x)), float(np.max(x))
    if not high > low:
        return None, np.zeros(0)
    knots = np.concatenate([[low] * 3, np.linspace(low, high, SMOOTH_KNOTS), [high] * 3])

    def basis(values: Array) -> Array:
        return np.asarray(BSpline.design_matrix(np.clip(values, low, high), knots, 3).toarray())

    middle = np.array([np.mean(knots[i + 1 : i + 4]) for i in range(len(knots) - 4)])  # where each gain acts
    slopes = np.diff(np.eye(len(middle)), axis=0) / np.diff(middle)[:, None]
    bends = np.diff(slopes, axis=0) * np.mean(np.diff(middle))
    size, along = np.linalg.eigh(bends.T @ bends)
    bent = along[:, 2:] / np.sqrt(size[2:])  # without the two that do not bend

    def straight(values: Array) -> Array:
        return np.column_stack([np.ones(len(values)), values])

    line = np.linalg.lstsq(straight(x), basis(x) @ bent, rcond=None)[0]
    at = np.linspace(low, high, SMOOTH_SHAPE_POINTS)
    return lambda values: basis(values) @ bent - straight(values) @ line, at
