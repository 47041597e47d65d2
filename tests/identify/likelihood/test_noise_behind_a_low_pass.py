"""A gyro whose noise all comes from ahead of its low-pass, on a platform in a control loop.

What disturbs the platform comes back in the torque. Noise that is taken for another then bends the parameters, which
it does not in an open loop.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from identify.likelihood.descent import Descent
from identify.likelihood.normal_equations import normal_equations
from identify.likelihood.prediction_error import PredictionError
from identify.model.structure import Structure
from identify.signals.prepare import prepare
from identify.signals.trace import Trace
from rig.recording.run import Run

INERTIA, DAMPING = 0.05, 0.37
LAG = ("sensor_lag_second_order", "time")
STEP_S, FINE, SECONDS = 4e-3, 20, 30.0
CORNER_HZ = 65.0
STRUCTURE = Structure(("inertia", "damping"), ("sensor_lag_second_order",))


def recorded(seed: int) -> list[Trace]:
    """Two runs under a proportional loop on the gyro's rate, disturbed, all of its noise ahead of its low-pass."""
    rng = np.random.default_rng(seed)
    h, n = STEP_S / FINE, round(SECONDS / STEP_S)
    keeps = np.exp(-DAMPING * h / INERTIA)
    pushes = (1.0 - keeps) / DAMPING
    (b0, b1, b2), (_, a1, a2) = signal.butter(2, CORNER_HZ, fs=1.0 / h)
    traces = []
    for number in range(2):
        time = STEP_S * np.arange(n)
        wanted = signal.chirp(time, 0.2, SECONDS, 3.0, phi=90.0 * number)
        disturbance = 2.1e-3 / np.sqrt(h) * rng.standard_normal(n * FINE)
        noise = 0.1 * rng.standard_normal(n * FINE)
        rate = held = kept = 0.0
        torque, readings = np.empty(n), np.empty(n)
        for i in range(n * FINE):
            k, given = i // FINE, rate + noise[i]
            sensed = b0 * given + held
            held, kept = b1 * given - a1 * sensed + kept, b2 * given - a2 * sensed
            if i % FINE == 0:
                readings[k], torque[k] = sensed, 2.0 * (wanted[k] - sensed)
            rate = rate * keeps + (torque[k] + disturbance[i]) * pushes
        run = Run(
            str(number), time, np.ones(n, dtype=bool), rate_rad_s=readings, torque_time_s=time, torque_nm=torque,
            torque_hold="zero_order",
        )  # fmt: skip
        traces.append(prepare(run, number, None))
    return traces


@pytest.fixture(scope="module")
def problem() -> PredictionError:
    """Of these runs."""
    return PredictionError(recorded(5))


START = {("inertia",): 0.05, ("damping",): 0.4, LAG: np.sqrt(2.0) / (2.0 * np.pi * CORNER_HZ)}


def test_noise_ahead_of_a_low_pass_bends_no_parameter_in_a_loop(problem: PredictionError) -> None:
    fit = problem.fit(STRUCTURE, START)
    for name, truth in ((("inertia",), INERTIA), (("damping",), DAMPING), (LAG, START[LAG])):
        assert abs(fit.values[name] - truth) < 3.0 * fit.std_error(name), name
    assert fit.variance < 0.5 * problem.least_variance  # of what is white behind the low-pass: there is none


def test_at_the_floor_the_cost_changes_with_the_noise_ahead_as_the_derivative_says(problem: PredictionError) -> None:
    noise = problem.fit(STRUCTURE, START, iterations=3, thorough=False).noise
    d = Descent(problem, STRUCTURE, START, replace(noise, ahead=4.0, white=30.0), None, ())
    floor = d.floor(d.kinds)
    assert not floor.variance_of(d._squares(d.looks), d.count)[1]
    assert floor.falls[len(d.x) + d.kinds.index("ahead")] > 0.5
    found = normal_equations(d._derivatives(True, True), len(d.x), len(d.kinds), d.count, floor)
    costs = [
        d.cost_of(d.looks_at(d.x, replace(d.noise, ahead=d.noise.ahead * float(np.exp(h))), d.shots))
        for h in (0.01, -0.01)
    ]
    slope = (costs[0] - costs[1]) / 0.02
    assert -2.0 * found.right[len(d.x) + d.kinds.index("ahead")] == pytest.approx(slope, rel=0.05)
