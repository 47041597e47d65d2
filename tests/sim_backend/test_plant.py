"""The simulated motion against closed forms and against far finer steps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rig.excitation import Sine
from rig.platform import Platform
from sim_backend.accuracy import largest_error_rad_s, played_rate
from sim_backend.plant import ANGLE_COLUMN, RATE_COLUMN, Plant

NOISE_RAD_S = math.radians(0.05)
COULOMB = Platform(effects={"coulomb_friction": {"level": 1.2}})
STRIBECK = Platform(effects={"stribeck_friction": {"coulomb": 3.2, "static": 5.0, "speed": 0.08}})
SLOW = Sine(torque_nm=110, frequency_hz=0.5, duration_s=2)
FAST = Sine(torque_nm=40, frequency_hz=9, duration_s=2)


def test_under_a_constant_torque_the_platform_rings_as_the_closed_form_says() -> None:
    p = Platform()
    plant = Plant(p, 1e-3)
    rate = np.array([plant.hold(50.0, plant.parts)[plant.parts - 1, RATE_COLUMN] for _ in range(2000)])
    t = 1e-3 * np.arange(1, 2001)
    decay = p.damping_nm_s_rad / (2 * p.inertia_kg_m2)
    w = math.sqrt(p.stiffness_nm_rad / p.inertia_kg_m2 - decay**2)
    exact = 50.0 / (p.inertia_kg_m2 * w) * np.exp(-decay * t) * np.sin(w * t)
    assert np.max(np.abs(rate - exact)) < 1e-6 * np.abs(exact).max()


def test_the_ring_of_a_platform_with_friction_shortens_by_four_levels_over_k_each_cycle() -> None:
    plant = Plant(Platform(damping_nm_s_rad=0.0, effects={"coulomb_friction": {"level": 2.0}}), 1e-3)
    plant.hold(60.0, 64 * plant.parts)
    angle = np.array([plant.hold(0.0, plant.parts)[plant.parts - 1, ANGLE_COLUMN] for _ in range(500)])
    crests = angle[1:-1][(angle[1:-1] > angle[:-2]) & (angle[1:-1] >= angle[2:]) & (angle[1:-1] > 0)]
    assert len(crests) >= 5
    np.testing.assert_allclose(np.diff(crests[:5]), -4 * 2.0 / 677.3, rtol=0.05)
    assert not np.diff(angle[-50:]).any(), "it has to stand still in the end"


@pytest.mark.parametrize("platform", [Platform(), COULOMB, STRIBECK], ids=["linear", "coulomb", "stribeck"])
@pytest.mark.parametrize("sine", [SLOW, FAST], ids=["0.5 Hz", "9 Hz"])
def test_what_is_played_differs_from_far_finer_steps_by_a_fraction_of_the_gyros_noise(
    platform: Platform, sine: Sine
) -> None:
    parts = Plant(platform, 1e-3).parts
    assert largest_error_rad_s(platform, sine, parts, 16 * parts) < 0.2 * NOISE_RAD_S


@pytest.mark.parametrize("platform", [Platform(), COULOMB], ids=["linear", "coulomb"])
def test_halving_the_step_divides_the_error_by_sixteen_also_through_stick_and_slip(
    platform: Platform,
) -> None:
    fine = played_rate(platform, FAST, 128)
    errors = [float(np.abs(played_rate(platform, FAST, parts) - fine).max()) for parts in (2, 4, 8)]
    assert errors[0] / errors[1] == pytest.approx(16, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(16, rel=0.2)


def test_fine_steps_get_finer_where_an_effect_is_fast() -> None:
    slow = Plant(Platform(stiffness_nm_rad=50.0), 1e-3)
    fast = Plant(Platform(stiffness_nm_rad=5000.0), 1e-3)
    assert slow.parts < Plant(Platform(), 1e-3).parts < fast.parts
