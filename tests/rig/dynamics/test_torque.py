"""The torque between its samples."""

from __future__ import annotations

import numpy as np
import pytest

from rig.dynamics import TorqueSignal
from rig.dynamics.torque import MAX_READINGS_KEPT
from rig.signals import TorqueHold

TIME = np.arange(1001) * 1e-3
BETWEEN = np.linspace(0.01, 0.99, 7777)


@pytest.mark.parametrize(("frequency_hz", "allowed"), [(9.0, 1e-9), (29.0, 1e-7), (80.0, 1e-4)])
def test_a_band_limited_torque_is_right_between_its_samples(frequency_hz: float, allowed: float) -> None:
    signal = TorqueSignal(TIME, np.sin(2 * np.pi * frequency_hz * TIME))
    assert np.max(np.abs(signal.at(BETWEEN) - np.sin(2 * np.pi * frequency_hz * BETWEEN))) < allowed


def test_a_held_torque_keeps_each_value_until_the_next_sample() -> None:
    signal = TorqueSignal(np.array([0.0, 1.0, 2.0]), np.array([1.0, 5.0, -2.0]), "zero_order")
    asked = np.array([-1.0, 0.0, 0.999, 1.0, 1.5, 2.0, 9.0])
    np.testing.assert_array_equal(signal.at(asked), [1, 1, 1, 5, 5, -2, -2])


def test_a_held_torque_enters_the_integrator_as_its_exact_mean_over_each_half_step() -> None:
    signal = TorqueSignal(np.array([0.0, 1.0, 2.0]), np.array([1.0, 5.0, -2.0]), "zero_order")
    # 0.75 to 1.25 holds 1 and 5, the next 5 alone, 1.75 to 2.25 holds 5 and -2.
    np.testing.assert_allclose(signal.on_half_steps(0.75, 0.5, 3), [3.0, 5.0, 1.5])


def test_outside_its_samples_a_torque_stays_at_its_last_value() -> None:
    signal = TorqueSignal(TIME, 3.0 + TIME)
    np.testing.assert_allclose(signal.at(np.array([-5.0, 7.0])), [3.0, 4.0])


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_a_few_samples_are_enough_for_a_spline_of_lower_degree(count: int) -> None:
    time = np.arange(float(count))
    np.testing.assert_allclose(TorqueSignal(time, 2.0 * time).at(np.array([0.5])), [1.0])


@pytest.mark.parametrize("hold", ["band_limited", "zero_order"])
def test_a_torque_asked_for_again_is_the_same_and_of_many_askings_few_are_kept(hold: TorqueHold) -> None:
    time = np.linspace(0.0, 1.0, 101)
    torque = TorqueSignal(time, np.sin(20.0 * time), hold)
    first = torque.on_half_steps(0.1, 1e-3, 500).copy()
    assert torque.on_half_steps(0.1, 1e-3, 500) is torque.on_half_steps(0.1, 1e-3, 500)
    for n in range(20):
        torque.on_half_steps(0.1, 1e-3, 400 + n)
    assert len(torque._read) <= MAX_READINGS_KEPT
    assert np.array_equal(torque.on_half_steps(0.1, 1e-3, 500), first)
    with pytest.raises(ValueError, match="read-only"):
        torque.on_half_steps(0.1, 1e-3, 500)[0] = 1.0
    assert not np.array_equal(torque.on_half_steps(0.2, 1e-3, 500), first)
