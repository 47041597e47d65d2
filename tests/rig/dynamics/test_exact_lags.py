"""Low-passes of the sensor along the prediction: as exact in one step a sample as a simulation in hundreds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.dynamics.exact_lags import CHORDS, lag_table
from rig.dynamics.gains import Noise, Sensing, gains_of
from rig.dynamics.linear_part import LinearPart
from rig.dynamics.predictor import predict_ahead
from rig.platform import Platform

STEP = 4e-3
TIME = STEP * np.arange(800)
JCK = (0.02, 0.05, 5.0)
TORQUE = TorqueSignal(TIME, np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 5.1 * TIME), "zero_order")
LAGS = {"sensor_lag": {"time": 1.1e-3}, "sensor_lag_second_order": {"time": 2.3e-3}}


def predicted(effects: dict[str, dict[str, float]], steps: int) -> Array:
    """The gyro's readings in so many fine steps a sample, never corrected."""
    equations, grid = Equations(Platform(*JCK, effects)), Grid(TIME, TORQUE, steps)
    keep, spans = np.ones(len(TIME), dtype=bool), [(0, len(TIME) - 1)]
    gains = gains_of(LinearPart(*JCK), Noise(), STEP, Sensing(True, 0.0), keep, spans)
    out, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, steps, spans, np.zeros((1, 2)),
        np.zeros((len(TIME), 1)), np.zeros(len(TIME), dtype=bool), gains, True, 0.0,
    )  # fmt: skip
    return out[:, 0]


@pytest.mark.parametrize("names", [["sensor_lag"], ["sensor_lag_second_order"], list(LAGS), []])
def test_a_step_a_sample_reads_what_a_fine_simulation_does(names: list[str]) -> None:
    effects = {name: LAGS[name] for name in names}
    fine = Grid(TIME, TORQUE, 512).simulate(Equations(Platform(*JCK, effects)), (0.0, 0.0)).sensed_rate_rad_s
    late = Grid(TIME, TORQUE, 512).simulate(Equations(Platform(*JCK)), (0.0, 0.0)).sensed_rate_rad_s
    error = float(np.max(np.abs(predicted(effects, 4) - fine)))
    assert error < 3e-6 * float(np.max(np.abs(fine)))
    assert not names or error < 1e-4 * float(np.max(np.abs(late - fine)))  # of what the lags do


def test_dry_friction_that_stops_the_platform_within_a_step_is_read_nearly_as_well() -> None:
    effects = {"coulomb_friction": {"level": 0.2}, **LAGS}
    fine = Grid(TIME, TORQUE, 512).simulate(Equations(Platform(*JCK, effects)), (0.0, 0.0)).sensed_rate_rad_s
    assert predicted(effects, 4) == pytest.approx(fine, abs=1e-3 * float(np.max(np.abs(fine))))


@pytest.mark.parametrize(("a", "b"), [(1e-3, 5e-7), (1e-3, 2.5e-7), (1e-3, 1e-7), (2e-2, 1e-4)])
def test_what_a_step_leaves_of_output_and_slope_is_the_matrix_exponential(a: float, b: float) -> None:
    row = lag_table([(a, b)], STEP)[0]
    matrix = np.array([[0.0, 1.0], [-1.0 / b, -a / b]])
    assert row[2:6].reshape(2, 2) == pytest.approx(expm(matrix * STEP), rel=1e-4, abs=1e-6 / b * a)
    assert row[6:].reshape(2, 2) == pytest.approx(expm(matrix * STEP / CHORDS), rel=1e-4, abs=1e-6 / b * a)


def test_a_lag_of_no_time_reads_the_rate_itself() -> None:
    effects = {"sensor_lag": {"time": 0.0}, "sensor_lag_second_order": {"time": 0.0}}
    assert predicted(effects, 4) == pytest.approx(predicted({}, 4), abs=1e-12)
