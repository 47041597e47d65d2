"""What is decimated for a search keeps its noise white, so that no effect is needed to describe the filter."""

from __future__ import annotations

from dataclasses import replace

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


def test_of_many_runs_the_one_that_reaches_farthest_is_looked_at() -> None:
    """What limits the drive shows in no other: with only evenly spread runs the search could not see it."""
    weak, strong = (
        [sine_run(torque_nm, 1.0, jck=SOFT, seed=i, duration_s=3.0) for i in range(12)] for torque_nm in (5.0, 9.0)
    )
    for strongest in range(12):
        runs = [strong[i] if i == strongest else run for i, run in enumerate(weak)]
        traces = one_noise([prepare(run, i) for i, run in enumerate(runs)], False)
        few, _ = reduced(traces, split(traces), enough=6000)
        assert len(few) < 12
        assert strongest in [t.number for t in few]


def test_of_a_long_run_the_span_with_the_largest_torque_is_looked_at() -> None:
    for at_s in (5.0, 11.0, 22.0, 35.0):
        run = sine_run(5.0, 1.0, jck=SOFT, duration_s=40.0, soft_s=3.0)
        assert run.torque_nm is not None
        there = np.abs(run.time_s - at_s) < 1.0
        run = replace(run, torque_nm=np.where(there, 1.5, 1.0) * run.torque_nm)
        traces = one_noise([prepare(run, 0)], False)
        few, _ = reduced(traces, split(traces), enough=2000)
        (piece,) = few
        assert len(piece.measured) * piece.step_s < 25.0
        assert piece.start_s < at_s < piece.start_s + len(piece.measured) * piece.step_s
