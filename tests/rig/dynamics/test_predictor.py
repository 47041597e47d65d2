"""The motion one sample ahead: a Kalman filter around the nonlinear simulator."""

from __future__ import annotations

import numpy as np
import pytest

from rig.arrays import Array
from rig.dynamics import Equations, Grid, TorqueSignal
from rig.dynamics.gains import RATE, Noise, Sensing, gains_of
from rig.dynamics.linear_part import LinearPart
from rig.dynamics.predictor import predict_ahead
from rig.platform import Platform

STEP = 2e-3
TIME = STEP * np.arange(3000)
JCK = np.array([0.02, 0.05, 30.0])
SIGMA = 1e-4


def disturbed(white: float, seed: int = 0) -> tuple[Array, Array]:
    """Torque and measured angle of a linear platform with a white torque that is not in the record."""
    rng = np.random.default_rng(seed)
    torque = np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 4.1 * TIME)
    hidden = white * rng.standard_normal(len(TIME))
    whole = TorqueSignal(TIME, torque + hidden, "zero_order")
    angle = Grid(TIME, whole, 8).simulate(Equations(Platform(*JCK)), (0.0, 0.0)).angle_rad
    return torque, angle + SIGMA * rng.standard_normal(len(TIME))


def innovations(torque: Array, angle: Array, noise: Noise, effects: dict[str, dict[str, float]] | None = None) -> Array:
    equations = Equations(Platform(*JCK, effects or {}))
    grid = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8)
    keep = np.ones(len(TIME), dtype=bool)
    spans = [(0, len(TIME) - 1)]
    gains = gains_of(LinearPart(*JCK), noise, STEP, Sensing(False, 1.0), keep, spans)
    read = angle[:, None]
    predicted, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, 8, spans, np.zeros((1, 2)), read, keep, gains, False, 0.0
    )  # fmt: skip
    return np.asarray((read - predicted) / np.sqrt(gains.variance))[:, 0]


def test_without_a_disturbance_the_prediction_is_the_simulation() -> None:
    torque, angle = disturbed(0.0)
    left = innovations(torque, angle, Noise())
    simulated = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8).simulate(Equations(Platform(*JCK)), (0.0, 0.0))
    assert left == pytest.approx(angle - simulated.angle_rad, abs=1e-12)


def test_behind_the_right_disturbance_the_innovations_are_white_and_as_large_as_the_sensors_noise() -> None:
    white = 0.05
    torque, angle = disturbed(white)
    left = innovations(torque, angle, Noise(white=white**2 * STEP / SIGMA**2))
    assert np.sqrt(np.mean(left**2)) == pytest.approx(SIGMA, rel=0.05)
    lags = [float(left[k:] @ left[:-k]) / float(left @ left) for k in range(1, 6)]
    assert np.max(np.abs(lags)) < 4.0 / np.sqrt(len(left))


def test_a_simulation_that_knows_no_disturbance_is_led_far_astray_by_it() -> None:
    torque, angle = disturbed(0.05)
    simulated = innovations(torque, angle, Noise())
    assert np.sqrt(np.mean(simulated**2)) > 10.0 * SIGMA


def test_dry_friction_stops_what_noise_would_move() -> None:
    rng = np.random.default_rng(3)
    angle = SIGMA * rng.standard_normal(len(TIME))  # a platform that stands, seen through noise
    held = innovations(
        np.zeros(len(TIME)), angle, Noise(white=1e-2 / SIGMA**2 * STEP), {"coulomb_friction": {"level": 5.0}}
    )
    free = innovations(np.zeros(len(TIME)), angle, Noise(white=1e-2 / SIGMA**2 * STEP))
    assert np.mean(held**2) < np.mean(free**2)


def test_a_lost_sample_makes_the_next_ones_less_certain_for_a_while() -> None:
    keep = np.ones(len(TIME), dtype=bool)
    keep[1000:1010] = False
    gains = gains_of(LinearPart(*JCK), Noise(white=1e4), STEP, Sensing(True), keep, [(0, len(TIME) - 1)])
    assert gains.variance[1010] > 1.5 * gains.variance[990]
    assert gains.variance[1600] == pytest.approx(gains.variance[990], rel=1e-3)
    assert not np.any(gains.gain[1000:1010])


SPANS = [(0, len(TIME) - 1)]
KEEP = np.ones(len(TIME), dtype=bool)
LATE = {"sensor_lag_second_order": {"time": 4e-3}}


def read_by_gyro(noise: Noise, sensing: Sensing, effects: dict[str, dict[str, float]], bias: Array) -> Array:
    """Scaled innovations of a gyro behind a low-pass, (n,), of a platform that no hidden torque disturbs."""
    rng = np.random.default_rng(5)
    torque = np.sin(2.0 * np.pi * 1.3 * TIME) + 0.5 * np.sin(2.0 * np.pi * 4.1 * TIME)
    grid = Grid(TIME, TorqueSignal(TIME, torque, "zero_order"), 8)
    true = Equations(Platform(*JCK, LATE))
    read = grid.simulate(true, (0.0, 0.0)).sensed_rate_rad_s + bias + SIGMA * rng.standard_normal(len(TIME))
    equations = Equations(Platform(*JCK, effects))
    gains = gains_of(LinearPart(*JCK), noise, STEP, sensing, KEEP, SPANS)
    predicted, _ = predict_ahead(
        equations, grid.shaft_torque(equations), grid.step_s, 8, SPANS, np.zeros((1, 2)), read[:, None], KEEP, gains,
        True, 0.0,
    )  # fmt: skip
    return np.asarray((read[:, None] - predicted) / np.sqrt(gains.variance))[:, 0]


def test_a_gyro_behind_its_low_pass_is_predicted_to_its_noise_though_the_rate_is_corrected_all_the_time() -> None:
    noise = Noise(white=1e-4 * STEP / SIGMA**2)
    left = read_by_gyro(noise, Sensing(True, lag=(4e-3, 8e-6)), LATE, np.zeros(len(TIME)))
    blind = read_by_gyro(noise, Sensing(True), {}, np.zeros(len(TIME)))
    assert np.sqrt(np.mean(left**2)) < 1.05 * SIGMA
    assert np.sqrt(np.mean(blind**2)) > 2.0 * SIGMA


def test_a_bias_that_walks_is_followed() -> None:
    per_s = 1e-3
    walk = np.cumsum(per_s * np.sqrt(STEP) * np.random.default_rng(6).standard_normal(len(TIME)))
    sensing = Sensing(True, lag=(4e-3, 8e-6))
    followed = read_by_gyro(Noise(walk=per_s**2 / SIGMA**2), sensing, LATE, walk)
    ignored = read_by_gyro(Noise(), sensing, LATE, walk)
    assert np.sqrt(np.mean(followed[500:] ** 2)) < 1.1 * SIGMA < 3.0 * SIGMA < np.sqrt(np.mean(ignored[500:] ** 2))


def test_an_encoder_beside_a_gyro_makes_the_next_angle_more_certain_than_either_alone() -> None:
    noise = Noise(white=1e2)
    alone = gains_of(LinearPart(*JCK), noise, STEP, Sensing(False, 1.0), KEEP, SPANS)
    both = gains_of(LinearPart(*JCK), noise, STEP, Sensing(True, 1.0), KEEP, SPANS)
    assert alone.variance.shape == (len(TIME), 1) and both.variance.shape == (len(TIME), 2)
    assert both.variance[-1, 1] < alone.variance[-1, 0]
    assert both.gain[-1, 0, RATE] > 0.0
