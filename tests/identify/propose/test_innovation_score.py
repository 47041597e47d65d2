"""What a candidate promises before it is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identify.estimate.initial_guess import scale_of
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.propose.innovation_score import InnovationScores
from identify.signals.prepare import one_noise, prepare
from rig.platform import TERMS
from tests.identify.simulated import TRUTH, sine_run, white

TIME_S = 2e-3


def test_a_slow_gyro_promises_what_it_explains_though_the_disturbance_hides_it_at_first() -> None:
    """A lag in the sensor changes how much the prediction errs, too: without that its score was zero."""
    runs = []
    for seed, (torque_nm, hertz) in enumerate(((104.0, 3.0), (67.0, 6.0))):
        run = sine_run(
            torque_nm, hertz, seed=seed, noise=2e-3, duration_s=2.0, effects={"sensor_lag": {"time": TIME_S}}
        )
        assert run.torque_nm is not None
        runs.append(replace(run, torque_nm=run.torque_nm + white(len(run.torque_nm), 0.02 * torque_nm, 7 + seed)))
    problem = PredictionError(one_noise([prepare(r, i) for i, r in enumerate(runs)], False))
    start = {(k,): v for k, v in zip(TERMS, TRUTH, strict=True)}
    now = problem.fit(Structure(), start)
    right = problem.fit(Structure(effects=("sensor_lag",)), {**start, ("sensor_lag", "time"): TIME_S})
    scale = scale_of(problem.traces, TRUTH, ())
    scores = {v[0].effect: v[0].gain for v in InnovationScores(problem, now, scale).all(["sensor_lag", "creep"])}
    assert now.cost - right.cost > 100.0
    assert scores["sensor_lag"] > 100.0, "what chance makes is far below that; it was zero"
    assert np.isfinite(scores["creep"])
