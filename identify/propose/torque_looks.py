"""What every candidate could carry of the torque that a model leaves, by least squares along the measured motion.

It sees at once what the likelihood may have to be led to: where a disturbance is as large as the torque itself, the
predictor follows the measurements and hardly asks for an effect, however plainly the torque goes with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.diagnose.coloured_residual import bounded
from identify.diagnose.torque_regression import TorqueFit, TorqueRegression, gains_at_zero, in_order
from identify.model.parameters import Name
from identify.propose.screening import grid_of
from rig import effects
from rig.arrays import Array
from rig.effects.base import Place


@dataclass(frozen=True)
class TorqueLook:
    """One candidate on top of a model.

    Attributes
    ----------
    fit
        The model with it.
    """

    effect: str
    fit: TorqueFit

    @property
    def left_nm(self) -> float:
        """Root mean square residual on held-out samples."""
        return self.fit.held_nm

    @property
    def start(self) -> dict[Name, float]:
        """Its parameter values for a fit to begin from, and those of the rest beside it."""
        return dict(self.fit.values)


def torque_looks(
    regression: TorqueRegression, now: TorqueFit, names: Sequence[str], most: int, polish: bool = False
) -> list[TorqueLook]:  # fmt: skip
    """The candidates that leave least on top of a model, what leaves least first; none that was fitted to nothing.

    Parameters
    ----------
    most
        How many.
    polish
        Search for the best shapes beside those of the grid.
    """
    lines_hz, orders = regression.lines(now)
    regression.scale = replace(regression.scale, lines_hz=lines_hz, orders=orders)
    base = _stacked(regression, now, now.structure.effects, now.shapes)
    basis = np.linalg.qr(base[0] / np.maximum(np.linalg.norm(base[0], axis=0), 1e-300))[0]
    found: list[tuple[float, str, tuple[float, ...]]] = []
    for name in names:
        effect = effects.get(name)
        if effect.place is Place.SENSOR:
            continue
        left = [(_left(regression, now, basis, name, shape), shape) for shape in grid_of(effect, regression.scale)]
        if left:
            squares, shape = min(left)
            found.append((squares, name, shape))
    looks = []
    for _, name, shape in sorted(found)[:most]:
        fit = regression.polished(now, name, shape) if polish else None
        fit = fit or regression.solve(now.structure.plus(name), {**now.shapes, name: shape})
        if in_order(fit.values, name) and not gains_at_zero(fit.values, name):
            looks.append(TorqueLook(name, fit))
    return sorted(looks, key=lambda w: w.left_nm)


def _stacked(
    regression: TorqueRegression, now: TorqueFit, names: Sequence[str], shapes: dict[str, tuple[float, ...]]
) -> tuple[Array, Array, list[Name]]:  # fmt: skip
    """Columns of a structure over all runs, biases with them, the target, and the columns' names."""
    return regression.stacked(replace(now.structure, effects=tuple(names)), shapes)


def _left(
    regression: TorqueRegression, now: TorqueFit, basis: Array, name: str, shape: tuple[float, ...]
) -> float:  # fmt: skip
    """Sum of squares that a candidate leaves at a shape, relative to the torque it passes on, on samples fitted."""
    effect = effects.get(name)
    if effect.place is Place.DRIVE or effect.leans_on:
        fit = regression.stacked(now.structure.plus(name), {**now.shapes, name: shape})
        wide, target = fit[0], fit[1]
        x = bounded(wide.T @ wide, wide.T @ target, np.full(wide.shape[1], -np.inf))
        left = target - wide @ x
        return float(left @ left) / max(float(target @ target), 1e-300) * regression.torque_nm**2 * len(target)
    wide, target, _ = regression.stacked(replace(now.structure, effects=(name,), terms=()), {name: shape})
    own = wide[:, : sum(p.linear for p in effect.parameters) if not any(p.per_run for p in effect.parameters) else None]
    target = regression.stacked(now.structure, now.shapes)[1]
    own = own - basis @ (basis.T @ own)
    rest = target - basis @ (basis.T @ target)
    low = np.array([p.low if not p.per_run else -np.inf for p in effect.parameters if p.linear])
    if len(low) != own.shape[1]:
        low = np.full(own.shape[1], -np.inf)
    x = bounded(own.T @ own, own.T @ rest, low)
    left = rest - own @ x
    return float(left @ left)
