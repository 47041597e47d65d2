"""What every candidate could carry of the torque that a model leaves, by least squares along the measured motion.

It sees at once what the likelihood may have to be led to: where a disturbance is as large as the torque itself, the
predictor follows the measurements and hardly asks for an effect, however plainly the torque goes with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize

from identify.diagnose.coloured_residual import bounded
from identify.diagnose.torque_fit import TorqueFit
from identify.diagnose.torque_regression import TorqueRegression
from identify.model.parameters import Name, gains_at_zero, in_order
from identify.propose.shape_grids import grid_of
from identify.runs.observability import runs_last_for
from rig import effects
from rig.effects.base import Place

EVALUATIONS = 30  # of a shape search
MAX_SHAPE_RATIO = 4.0  # times the outermost starting values: how far a shape may wander


@dataclass(frozen=True)
class CandidateTorque:
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


def candidate_torques(
    regression: TorqueRegression, now: TorqueFit, names: Sequence[str], most: int
) -> list[CandidateTorque]:
    """The candidates that leave least on top of a model, what leaves least first; none that was fitted to nothing.

    They are chosen at the shapes of their grid; the shapes of the ``most`` that leave least are then refined. A fit
    that begins at a grid value beyond the right one may end in another valley (a torque limit that clips nothing).
    """
    lines_hz, orders = regression.lines(now)
    regression.scale = replace(regression.scale, lines_hz=lines_hz, orders=orders)
    beside = _Beside(regression, now)
    found: list[tuple[float, str, tuple[float, ...]]] = []
    for name in names:
        effect = effects.get(name)
        if effect.place is Place.SENSOR:
            continue
        left = [(beside.left(name, shape), shape) for shape in grid_of(effect, regression.scale)]
        if left:
            squares, shape = min(left)
            found.append((squares, name, shape))
    looks = []
    for _, name, shape in sorted(found)[:most]:
        refined = beside.refined(name, shape)
        fit = regression.solve(now.structure.plus(name), {**now.shapes, name: refined})
        whole = runs_last_for(name, fit.values, regression.traces)
        if whole and in_order(fit.values, name) and not gains_at_zero(fit.values, name):
            looks.append(CandidateTorque(name, fit))
    return sorted(looks, key=lambda w: w.left_nm)


class _Beside:
    """What single effects leave beside a model whose own columns are projected out once."""

    def __init__(self, regression: TorqueRegression, now: TorqueFit) -> None:
        self.regression, self.now = regression, now
        columns, target, _ = regression.stacked(now.structure, now.shapes)
        self.basis = np.linalg.qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300))[0]
        self.rest = target - self.basis @ (self.basis.T @ target)

    def left(self, name: str, shape: tuple[float, ...]) -> float:
        """Sum of squares that a candidate leaves at a shape, relative to the torque it passes on; as fitted."""
        effect, regression = effects.get(name), self.regression
        if effect.place is Place.DRIVE or effect.leans_on:
            wide, target, _ = regression.stacked(self.now.structure.plus(name), {**self.now.shapes, name: shape})
            x = bounded(wide.T @ wide, wide.T @ target, np.full(wide.shape[1], -np.inf))
            left = target - wide @ x
            return float(left @ left) / max(float(target @ target), 1e-300) * regression.torque_nm**2 * len(target)
        own = regression.own_columns(name, shape)
        own = own - self.basis @ (self.basis.T @ own)
        low = np.array([p.low if not p.per_run else -np.inf for p in effect.parameters if p.linear])
        if len(low) != own.shape[1]:
            low = np.full(own.shape[1], -np.inf)
        x = bounded(own.T @ own, own.T @ self.rest, low)
        left = self.rest - own @ x
        return float(left @ left)

    def refined(self, name: str, shape: tuple[float, ...]) -> tuple[float, ...]:
        """The best shape of an effect near one of a grid."""
        axes = [p for p in effects.get(name).parameters if not p.linear]
        if not axes:
            return shape
        starts = [p.start(self.regression.scale) if p.start else (1.0,) for p in axes]
        bounds = [
            (max(p.low, min(s) / MAX_SHAPE_RATIO, 1e-12), min(p.high, MAX_SHAPE_RATIO * max(s)))
            for p, s in zip(axes, starts, strict=True)
        ]

        def inside(u: Any) -> tuple[float, ...]:
            return tuple(float(np.clip(np.exp(x), lo, hi)) for x, (lo, hi) in zip(u, bounds, strict=True))

        begin: Any = np.log(np.maximum(shape, 1e-12))
        simplex = np.vstack([begin, begin + 0.25 * np.eye(len(begin))])
        options: Any = {"maxfev": EVALUATIONS, "initial_simplex": simplex, "xatol": 1e-3}

        def loss(u: Any) -> float:
            return self.left(name, inside(u))

        found: Any = minimize(loss, begin, method="Nelder-Mead", options=options)
        return min((shape, inside(found.x)), key=lambda s: self.left(name, s))
