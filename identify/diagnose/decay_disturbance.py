"""What a model leaves of a free decay, as a torque per unit of inertia along the measured motion."""

from __future__ import annotations

from collections.abc import Sequence

from identify.diagnose.disturbance import disturbance_of
from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.final_fit import FinalFit
from identify.estimate.initial_guess import Start, scale_of
from identify.model.structure import shape_values
from identify.residual import Disturbance
from identify.runs.holdout import Split
from identify.runs.reduced import reduced
from identify.signals.trace import Trace
from rig import effects


def left_of_a_decay(traces: Sequence[Trace], split: Split, fitted: FinalFit, start: Start, axis: str) -> Disturbance:
    """The disturbance that a final model leaves of runs without torque, in rad/s^2 (m/s^2 on a linear axis)."""
    few, parts = reduced(traces, split)
    regression = TorqueRegression(few, parts, start.cutoff_hz, scale_of(few, start.platform, ()))
    shapes = {}
    for name in fitted.structure.effects:
        own = {p.name: fitted.values.get((name, p.name), p.neutral) for p in effects.get(name).parameters}
        shapes[name] = shape_values(name, own)
    fit = regression.solve(fitted.structure, shapes)
    unit = "m/s^2" if axis == "linear" else "rad/s^2"
    return disturbance_of(regression, fit, regression.noise_floor_nm(fit.values), unit)
