"""Prediction error: sensor noise and a torque disturbance in one likelihood."""

from __future__ import annotations

import numpy as np
import pytest

from identify.estimate.initial_guess import first_guess
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import one_noise, prepare
from identify.signals.trace import Trace
from rig.platform import TERMS
from rig.recording.run import Recording
from tests.identify.servo import Servo
from tests.identify.simulated import SETS, TRUTH, sine_run


def traces_of(recording: Recording) -> list[Trace]:
    return one_noise([prepare(r, i) for i, r in enumerate(recording.runs)], False)


def fitted(recording: Recording, terms: tuple[str, ...] = TERMS):  # type: ignore[no-untyped-def]
    traces = traces_of(recording)
    start = first_guess(traces, Structure(terms))
    problem = PredictionError(traces)
    values = {(k,): v for k, v in zip(TERMS, start.platform, strict=True) if k in terms}
    return problem, problem.fit(Structure(terms), values)  # type: ignore[arg-type]


def test_a_closed_loop_with_a_disturbance_gives_inertia_and_damping_within_their_errors() -> None:
    servo = Servo()
    problem, fit = fitted(servo.recording(2), ("inertia", "damping"))
    for name, truth in (("inertia", servo.inertia), ("damping", servo.damping)):
        assert abs(fit.values[(name,)] - truth) < 4.0 * fit.std_error((name,))
    assert fit.std_error(("inertia",)) < 0.01 * servo.inertia
    white = np.sqrt(fit.noise.white / (2.0 * problem.step_s) * fit.variance) / problem.torque_nm
    assert white == pytest.approx(servo.white, rel=0.5)


def test_without_a_disturbance_none_is_found_and_the_estimate_is_as_sharp_as_output_error() -> None:
    runs = tuple(sine_run(m, f, seed=i) for i, (m, f) in enumerate(SETS[1:3]))
    problem, fit = fitted(Recording(runs))
    white = np.sqrt(fit.noise.white / (2.0 * problem.step_s) * fit.variance) / problem.torque_nm
    assert white < 1e-4
    for name, truth in zip(TERMS, TRUTH, strict=True):
        assert abs(fit.values[(name,)] - truth) < 4.0 * fit.std_error((name,))
        assert fit.std_error((name,)) < 1e-2 * truth
