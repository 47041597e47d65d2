"""The integrated motion against closed forms and far finer steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.arrays import Array
from rig.dynamics import Equations, TorqueSignal, simulate
from rig.dynamics.grid import FINE_SUBSTEPS
from rig.platform import Platform

NOISE_RAD_S = math.radians(0.05)  # of one gyro sample
COULOMB = {"coulomb_friction": {"level": 1.2}}
STRIBECK = {"stribeck_friction": {"coulomb": 3.2, "static": 5.0, "speed": 0.08}}


def sine(torque_nm: float, frequency_hz: float, duration_s: float) -> tuple[Array, TorqueSignal]:
    time = np.arange(round(duration_s * 1000) + 1) * 1e-3
    return time, TorqueSignal(time, torque_nm * np.sin(2 * np.pi * frequency_hz * time))


def exact_rate(time: Array, torque_nm: float, frequency_hz: float, p: Platform) -> Array:
    """Rate of the linear platform from rest under a sine: steady state and ring."""
    j, c, k = p.inertia_kg_m2, p.damping_nm_s_rad, p.stiffness_nm_rad
    w = 2 * np.pi * frequency_hz
    steady = torque_nm / (k - j * w * w + 1j * c * w)  # angle = Im(steady exp(i w t))
    decay = -c / (2 * j)
    ring = math.sqrt(k / j - decay**2)
    a = -steady.imag
    b = (-(steady * 1j * w).imag - decay * a) / ring
    turning = (decay * a + ring * b) * np.cos(ring * time) + (decay * b - ring * a) * np.sin(ring * time)
    return np.asarray((steady * 1j * w * np.exp(1j * w * time)).imag + np.exp(decay * time) * turning)


@pytest.mark.parametrize(("torque_nm", "frequency_hz"), [(300, 0.5), (150, 9)])
def test_ten_seconds_of_the_linear_platform_are_right_to_a_small_part_of_the_noise(
    torque_nm: float, frequency_hz: float
) -> None:
    time, torque = sine(torque_nm, frequency_hz, 10)
    rate = simulate(Platform(), time, torque).rate_rad_s
    assert np.max(np.abs(rate - exact_rate(time, torque_nm, frequency_hz, Platform()))) < 0.05 * NOISE_RAD_S


@pytest.mark.parametrize("effects", [{}, COULOMB, STRIBECK], ids=["linear", "coulomb", "stribeck"])
@pytest.mark.parametrize(("torque_nm", "frequency_hz"), [(110, 0.5), (40, 9)])
def test_four_times_finer_steps_divide_the_error_by_two_hundred_and_fifty_six(
    effects: dict[str, dict[str, float]], torque_nm: float, frequency_hz: float
) -> None:
    time, torque = sine(torque_nm, frequency_hz, 2)
    platform = Platform(effects=effects)
    fine = simulate(platform, time, torque, substeps=384).rate_rad_s
    coarse, finer = (np.abs(simulate(platform, time, torque, substeps=n).rate_rad_s - fine).max() for n in (12, 48))
    assert coarse < 0.1 * NOISE_RAD_S
    # Exactly 256 on smooth motion; the breakaway of Stribeck friction reaches its order later.
    assert coarse / finer == pytest.approx(256, rel=0.5 if effects == STRIBECK else 0.1)


def test_below_the_friction_level_nothing_moves_and_above_it_the_platform_breaks_away() -> None:
    time, _ = sine(1, 1, 1)
    platform = Platform(effects={"coulomb_friction": {"level": 2.0}})
    held = simulate(platform, time, TorqueSignal(time, 1.999 * np.sin(2 * np.pi * time)))
    assert not held.angle_rad.any()
    assert not held.rate_rad_s.any()
    loose = simulate(platform, time, TorqueSignal(time, 2.001 * np.sin(2 * np.pi * time)))
    assert loose.angle_rad.any()


def test_a_stuck_platform_breaks_away_when_the_torque_reaches_the_static_level() -> None:
    time = np.arange(2001) * 1e-3
    platform = Platform(
        stiffness_nm_rad=0.0, effects={"stribeck_friction": {"coulomb": 1.0, "static": 3.0, "speed": 1}}
    )
    rate = simulate(platform, time, TorqueSignal(time, 2.0 * time)).rate_rad_s
    assert time[np.argmax(rate > 0)] == pytest.approx(1.5, abs=0.0021)


def test_coulomb_friction_on_a_free_wheel_brakes_evenly_and_stops_for_good() -> None:
    platform = Platform(0.02, 0.0, 0.0, {"coulomb_friction": {"level": 0.5}})
    time = np.arange(1001) * 1e-3
    motion = simulate(platform, time, None, start=(0.0, 10.0))
    np.testing.assert_allclose(motion.rate_rad_s, np.maximum(10.0 - 25.0 * time, 0.0), atol=1e-9)
    assert motion.angle_rad[-1] == pytest.approx(2.0, abs=1e-9)


def test_with_friction_and_no_torque_energy_is_lost_as_friction_times_the_way() -> None:
    platform = Platform(0.02, 0.0, 677.3, {"coulomb_friction": {"level": 1.0}})
    time = np.arange(200) * 1e-3
    motion = simulate(platform, time, None, start=(0.1, 0.0), substeps=32)
    energy = 0.5 * 0.02 * motion.rate_rad_s**2 + 0.5 * 677.3 * motion.angle_rad**2
    fine = simulate(platform, np.arange(199 * 50 + 1) * 2e-5, None, start=(0.1, 0.0)).angle_rad
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(fine)))])[::50]
    np.testing.assert_allclose(energy[0] - energy, way, atol=2e-4)


def test_a_run_that_diverges_ends_in_nan_and_not_in_an_exception() -> None:
    time, torque = sine(300, 1, 2)
    rate = simulate(Platform(stiffness_nm_rad=-5000.0), time, torque).rate_rad_s
    assert np.isfinite(rate[0])
    assert np.isnan(rate[-1])


KINKED = {
    "gap": {"backlash": {"half_gap": 0.004}},
    "one side": {"bilinear_stiffness": {"step": 60.0}},
    "gap and friction": {"backlash": {"half_gap": 0.004}, "coulomb_friction": {"level": 0.5}},
}


@pytest.mark.parametrize("effects", KINKED.values(), ids=KINKED)
def test_a_kink_of_the_torque_costs_no_order(effects: dict[str, dict[str, float]]) -> None:
    """A Runge-Kutta step that spans a kink errs with its second power; cut there, with its fourth."""
    time, torque = sine(40, 3, 2)
    platform = Platform(effects=effects)
    fine = simulate(platform, time, torque, substeps=128).rate_rad_s
    coarse, finer = (np.abs(simulate(platform, time, torque, substeps=n).rate_rad_s - fine).max() for n in (2, 8))
    assert coarse < 0.5 * NOISE_RAD_S
    assert coarse / finer > 100.0


@pytest.mark.parametrize("half_gap", [1e-4, 3e-4])
def test_a_gap_that_is_crossed_within_a_step_costs_no_order_either(half_gap: float) -> None:
    """Both its edges lie within one step. Only the first was found: damping was 0.08 % off, sixty standard errors."""
    time, torque = sine(60, 3, 2)
    platform = Platform(effects={"backlash": {"half_gap": half_gap}})
    fine = simulate(platform, time, torque, substeps=128)
    assert np.abs(np.diff(fine.angle_rad)).max() / 2 > 1.2 * 2.0 * half_gap
    rates = (simulate(platform, time, torque, substeps=n).rate_rad_s for n in (2, 8))
    coarse, finer = (np.abs(rate - fine.rate_rad_s).max() for rate in rates)
    assert coarse < 0.2 * NOISE_RAD_S
    assert coarse / finer > 100.0


@pytest.mark.parametrize(
    "effects",
    [{"torque_deadzone": {"width": 1.4}}, {"torque_saturation": {"limit": 30.0}},
     {"torque_deadzone": {"width": 1.4}, "torque_delay": {"delay": 3e-4}}],
    ids=["deadzone", "saturation", "late"],
)  # fmt: skip
def test_a_corner_of_the_torque_inside_a_step_is_felt_as_it_is(effects: dict[str, dict[str, float]]) -> None:
    time, torque = sine(40, 3, 2)
    platform = Platform(effects=effects)
    fine = simulate(platform, time, torque, substeps=128).rate_rad_s
    for substeps in (4, FINE_SUBSTEPS):  # with as many no step is divided further
        assert np.abs(simulate(platform, time, torque, substeps=substeps).rate_rad_s - fine).max() < 0.05 * NOISE_RAD_S


FOLLOWING = {
    "presliding": {"presliding_friction": {"level": 0.5, "displacement": 0.002}},
    "hysteresis": {"hysteresis": {"level": 0.5, "yield_angle": 0.002, "exponent": 1.0, "share": 0.5}},
    "sharp knee": {"hysteresis": {"level": 0.5, "yield_angle": 0.01, "exponent": 6.0, "share": 0.5}},
}


@pytest.mark.parametrize("effects", FOLLOWING.values(), ids=FOLLOWING)
@pytest.mark.parametrize("substeps", [None, 2])
@pytest.mark.parametrize("rate_rad_s", [5.0, 30.0, 60.0, 300.0, 2000.0])
def test_a_contact_that_slides_fast_resists_with_its_level_and_no_more(
    effects: dict[str, dict[str, float]], substeps: int | None, rate_rad_s: float
) -> None:
    """In one fine step the platform turns through many times the angle within which the contact bends."""
    time = np.arange(301) * 1e-3
    platform = Platform(0.01, 0.02, 0.0, effects)
    torque = TorqueSignal(time, np.full(len(time), 0.02 * rate_rad_s + 0.5))
    rate = simulate(platform, time, torque, (0.0, rate_rad_s), substeps).rate_rad_s
    assert rate[-1] == pytest.approx(rate_rad_s, abs=0.03)  # what it gained before the contact was bent
    np.testing.assert_allclose(np.diff(rate[10:]), -0.002 * (rate[10:-1] - rate_rad_s), atol=1e-6)


@pytest.mark.parametrize("effects", FOLLOWING.values(), ids=FOLLOWING)
@pytest.mark.parametrize(("peak_rad_s", "missed_rad_s"), [(60.0, 0.5 * NOISE_RAD_S), (300.0, 1e-4 * 300.0)])
def test_a_servo_that_reverses_fast_is_as_right_as_on_finer_steps(
    effects: dict[str, dict[str, float]], peak_rad_s: float, missed_rad_s: float
) -> None:
    time, torque = sine(peak_rad_s * math.hypot(0.01 * 2 * np.pi, 0.02), 1, 2)
    platform = Platform(0.01, 0.02, 0.0, effects)
    usual = Equations(platform).substeps(1e-3)
    rate = simulate(platform, time, torque).rate_rad_s
    finer = simulate(platform, time, torque, substeps=16 * usual).rate_rad_s
    assert np.max(np.abs(rate)) > peak_rad_s
    assert np.max(np.abs(rate - finer)) < missed_rad_s
