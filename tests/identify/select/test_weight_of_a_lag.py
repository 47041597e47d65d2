"""A lag of the gyro has no torque of its own, but makes the motion late: what is left as a torque must show it."""

from __future__ import annotations

import numpy as np
import pytest

from identify.diagnose.torque_regression import TorqueRegression
from identify.estimate.initial_guess import scale_of
from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.select.evidence import EvidenceModel
from identify.signals.prepare import one_noise, prepare
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, Effects, sine_run

SETS = ((67.0, 6.0), (111.0, 1.0), (104.0, 3.0), (42.0, 9.0))
LAG_S = 2e-3


def weight_of_a_lag(effects: Effects) -> tuple[float, float]:
    """Of a gyro's low-pass beside J, C and K: what it takes of the disturbance, and how much the cost falls."""
    runs = [sine_run(m, f, seed=i, effects=effects, duration_s=2.5) for i, (m, f) in enumerate(SETS)]
    traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
    problem = PredictionError(traces)
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    base = problem.fit(Structure(), platform)
    regression = TorqueRegression(traces, split(traces), 50.0, scale_of(traces, TRUTH, ()))
    weigher = EvidenceModel(problem, regression, regression.noise_floor_nm(base.values))
    late = problem.fit(Structure().plus("sensor_lag"), {**base.values, ("sensor_lag", "time"): LAG_S}, base.noise)
    found = weigher.evidence("sensor_lag", base, late)
    return found.weight, found.gain


def test_a_lag_that_is_there_takes_what_is_left_in_torque() -> None:
    weight, gain = weight_of_a_lag({"sensor_lag": {"time": LAG_S}})
    assert weight > 0.9
    assert gain > 1000.0


@pytest.mark.parametrize(
    "effects",
    [
        {"flexible_mode": {"inertia": 0.004, "frequency": 14.0, "ratio": 0.02}},
        {"cubic_stiffness": {"factor": 4000.0}},
    ],
)
def test_a_lag_that_smooths_the_torque_of_something_else_takes_none_of_it(effects: Effects) -> None:
    weight, _ = weight_of_a_lag(effects)
    assert np.isfinite(weight)
    assert weight < 0.2
