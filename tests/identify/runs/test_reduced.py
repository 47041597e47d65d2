"""What is decimated for a search keeps its noise white, so that no effect is needed to describe the filter."""

from __future__ import annotations

import numpy as np

from identify.likelihood.prediction_error import PredictionError
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.runs.holdout import split
from identify.runs.reduced import reduced
from identify.signals.prepare import one_noise, prepare
from rig.platform import TERMS
from tests.identify.simulated import sine_run

SOFT = (0.0121, 0.0072, 77.8)
SETS = ((7.9, 0.5), (7.5, 1.0), (7.7, 3.0), (3.9, 6.0))
LAG_S = 3e-3


def test_a_lag_of_the_drive_is_not_taken_for_one_of_the_gyro_because_of_the_filter() -> None:
    hidden = {"actuator_lag": {"time": LAG_S}}
    runs = [sine_run(m, f, effects=hidden, jck=SOFT, seed=i) for i, (m, f) in enumerate(SETS)]
    traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
    few, _ = reduced(traces, split(traces), enough=4000)
    assert few[0].step_s > 3.0 * traces[0].step_s
    problem = PredictionError(few)
    platform: dict[Name, float] = {(k,): v for k, v in zip(TERMS, SOFT, strict=True)}
    fits = {
        lag: problem.fit(Structure().plus(lag), {**platform, (lag, "time"): LAG_S})
        for lag in ("actuator_lag", "sensor_lag")
    }
    right = fits["actuator_lag"]
    assert right.cost < fits["sensor_lag"].cost + 10.0
    assert right.reduced_chi_square < 1.02
    told = zip(right.prediction.innovations, right.prediction.variance, strict=True)
    scaled = np.concatenate([e / np.sqrt(v * right.variance) for e, v in told])
    next_to = float(np.mean(scaled[1:] * scaled[:-1])) / float(np.mean(scaled**2))
    assert abs(next_to) < 4.0 / np.sqrt(len(scaled))
