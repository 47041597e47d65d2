"""What the noise does to the innovations, where a gap bends the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identify.likelihood.descent import Descent
from identify.likelihood.normal_equations import normal_equations
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from rig.dynamics.gains import Noise
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run

GAP_RAD = 2e-3


def test_a_step_of_the_noise_beside_a_backlash_changes_the_cost_as_the_derivative_says() -> None:
    run = sine_run(104.0, 3.0, seed=1, effects={"backlash": {"half_gap": GAP_RAD}})
    problem = PredictionError(one_noise([prepare(run, 0)], False))
    values = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)} | {("backlash", "half_gap"): 1.5 * GAP_RAD}
    disturbed = Noise(problem.bounds.white(0.01), problem.bounds.slow(0.02), 0.05, problem.bounds.walk(1e-3))
    d = Descent(problem, Structure(effects=("backlash",)), values, disturbed, None, ())  # type: ignore[arg-type]
    found = normal_equations(d._derivatives(True, True), len(d.x), len(d.kinds), d.count, d.floor(d.kinds))
    for k, kind in enumerate(d.kinds):
        costs = []
        for h in (0.01, -0.01):
            noise = replace(d.noise, **{kind: getattr(d.noise, kind) * float(np.exp(h))})
            costs.append(d.cost_of(d.looks_at(d.x, noise, d.shots)))
        slope = (costs[0] - costs[1]) / 0.02
        promised = -2.0 * found.right[len(d.x) + k]
        assert promised == pytest.approx(slope, rel=0.05, abs=1.0), kind
