"""The motor of Eq. 6, against its closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.config.simulated import MotorAmplifier
from sim_backend.motor import CURRENT, motor_state, motor_torque

STEP_S = 1e-4


def played(motor: MotorAmplifier, torque_nm: float, rate_rad_s: float, seconds: float) -> np.ndarray:
    state = motor_state(motor)
    return np.array([motor_torque(state, torque_nm, rate_rad_s, STEP_S) for _ in range(round(seconds / STEP_S))])


def test_the_current_loop_approaches_the_torque_with_one_pole_at_its_bandwidth() -> None:
    torque = played(MotorAmplifier(kind="motor", bandwidth_hz=200), 30.0, 0.0, 0.01)
    edges = STEP_S * np.arange(101)
    tau = 1 / (2 * math.pi * 200)
    mean = 30.0 * (1 + tau * np.diff(np.exp(-edges / tau)) / STEP_S)
    np.testing.assert_allclose(torque, mean, rtol=1e-9)


def test_a_current_loop_hides_back_emf_until_the_voltage_limit() -> None:
    motor = MotorAmplifier(kind="motor", resistance_ohm=1, torque_constant_nm_a=6, voltage_limit_v=100)
    free = played(motor, 60.0, 0.0, 0.05)[-1]
    moving = played(motor, 60.0, 10.0, 0.05)[-1]  # 10 A x 1 ohm + 6 x 10 V = 70 V
    limited = played(motor, 60.0, 16.0, 0.05)[-1]  # 4 V are left for the current
    assert free == pytest.approx(60.0)
    assert moving == pytest.approx(60.0)
    assert limited == pytest.approx((100 - 6 * 16) * 6, rel=1e-6)


def test_under_voltage_drive_back_emf_is_damping_of_kt_squared_over_r() -> None:
    motor = MotorAmplifier(kind="motor", control="voltage", resistance_ohm=2, torque_constant_nm_a=6)
    lost = played(motor, 60.0, 0.0, 0.2)[-1] - played(motor, 60.0, 0.5, 0.2)[-1]
    assert lost / 0.5 == pytest.approx(6**2 / 2, rel=1e-9)


def test_under_voltage_drive_the_current_rises_with_the_electric_time_constant() -> None:
    motor = MotorAmplifier(kind="motor", control="voltage", resistance_ohm=1, inductance_h=5e-3)
    state = motor_state(motor)
    for _ in range(50):  # one time constant L/R
        motor_torque(state, 60.0, 0.0, STEP_S)
    assert state[CURRENT] == pytest.approx(10.0 * (1 - math.exp(-1)), rel=1e-9)


def test_a_gear_multiplies_torque_and_speed_and_loses_its_efficiency() -> None:
    motor = MotorAmplifier(
        kind="motor", control="voltage", torque_constant_nm_a=0.5, gear_ratio=20, gear_efficiency=0.8
    )
    state = motor_state(motor)
    for _ in range(5000):
        torque = motor_torque(state, 40.0, 0.0, STEP_S)
    assert torque == pytest.approx(40.0)
    assert state[CURRENT] == pytest.approx(40.0 / (0.5 * 20 * 0.8))
    moving = played(motor, 40.0, 1.0, 0.5)[-1]
    assert 40.0 - moving == pytest.approx(0.8 * (0.5 * 20) ** 2 / 1.0, rel=1e-9)


def test_the_voltage_limit_also_limits_how_fast_the_current_rises() -> None:
    motor = MotorAmplifier(kind="motor", bandwidth_hz=5000, voltage_limit_v=20, inductance_h=1e-2)
    first = played(motor, 60.0, 0.0, STEP_S)[0] / 6.0
    assert first == pytest.approx(0.5 * 20 / 1e-2 * STEP_S, rel=0.02)


def test_leaving_saturation_does_not_overshoot() -> None:
    motor = MotorAmplifier(kind="motor", bandwidth_hz=5000, voltage_limit_v=20, inductance_h=1e-2)
    assert played(motor, 60.0, 0.0, 0.1).max() <= 60.0 + 1e-9
